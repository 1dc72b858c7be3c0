"""Strategies that were found in bags, looked through by a person, back into the bags as their labels."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from msrd_ros.bags.reader import Bag
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.curation import Curation
from msrd_ros.recordings.journal import RELABEL, Edit
from msrd_ros.robots.robot import Robot


@dataclass(frozen=True)
class FoundStrategies:
    """What ``strategies.json`` of a trainer says, after a person has renamed what is in it.

    Attributes
    ----------
    path
        The file.
    labels
        Strategy of each bag, by the bag's path without links.
    doubted
        Bags whose own label was found to be more likely wrong than right.
    """

    path: Path
    labels: Mapping[Path, StrategyLabel]
    doubted: frozenset[Path]

    @classmethod
    def read(cls, path: Path | str) -> FoundStrategies:
        """Read a file; strategies that were given one name are one.

        Raises
        ------
        UserError
            If it cannot be read, is no such file, a strategy's name is not well-formed, or a bag is of two.
        """
        path = Path(path)
        try:
            # As pairs: of two strategies of one name a dictionary would keep the last.
            content = dict(json.loads(path.read_text(encoding="utf-8"), object_pairs_hook=list))
            strategies = [(name, list(map(dict, strokes))) for name, strokes in content["strategies"]]
            doubted = list(map(dict, content["doubted"]))
        except OSError as error:
            raise UserError(f"{path}: cannot be read ({error.strerror})") from None
        except (ValueError, TypeError, KeyError):
            raise UserError(
                f"{path}: is no list of strategies; give the strategies.json that a trainer with "
                "labels:=discover has written"
            ) from None
        labels: dict[Path, StrategyLabel] = {}
        for text, strokes in strategies:
            label = StrategyLabel.parse(text, f"{path}: strategies")
            for stroke in strokes:
                bag = _bag(path, text, stroke)
                if labels.setdefault(bag, label) != label:
                    raise UserError(
                        f"{path}: bag {bag} is of {labels[bag]} and of {label}; record one bag a stroke"
                    )
        return cls(path, labels, frozenset(_bag(path, "doubted", stroke) for stroke in doubted))

    def relabel(
        self,
        folder: Path | str,
        robot: Robot | None = None,
        names: Mapping[str, str] | None = None,
        tell: Callable[[str], object] = lambda note: None,
    ) -> Iterator[Edit]:
        """Give the bags of a folder the labels of their strategies, one edit each; `restore` takes each back.

        Bags that have the label already stay as they are. So do doubted ones, which are flagged with what
        they say and rather are: who takes one out of ``doubted`` has it relabelled. What an earlier call that
        was cut off has done is not done again.

        Parameters
        ----------
        folder
            Of bags, or one bag; what the file says of bags elsewhere is left alone.
        robot, names
            As of `Curation`.
        tell
            Takes what is said of an edit that a crash has cut off.

        Raises
        ------
        UserError
            Before anything is changed, if the file names none of the folder's bags or one that is not there;
            else as `Curation.relabel` and `Curation.flag`.
        """
        top = Path(folder).resolve()
        bags = [bag for bag in self.labels if bag.is_relative_to(top)]
        if not bags:
            raise UserError(f"{self.path}: names no bag in {top}; give the folder that was trained on")
        work: list[tuple[Curation, Path, Path]] = []
        for bag in bags:
            curation = Curation.of(bag, robot, names)
            for note in curation.mend():
                tell(note)
            present = self._followed(curation, bag)
            curation.locate(present)
            work.append((curation, bag, present))
        for curation, bag, present in work:
            found = Bag(present, names)
            labels, wanted = found.labels(found.raw()), self.labels[bag]
            if labels == {wanted}:
                continue
            if bag not in self.doubted:
                yield curation.relabel(present, wanted)
                continue
            flag = f"says {', '.join(sorted(labels)) or 'nothing'}, but is rather {wanted}"
            if flag not in curation.flags().get(curation.locate(present), ()):
                yield curation.flag(present, flag)

    def _followed(self, curation: Curation, bag: Path) -> Path:
        """Where a bag is now, if it has been relabelled since the file was written."""
        written = datetime.fromtimestamp(self.path.stat().st_mtime, UTC)
        name = curation.relative(bag)
        for edit in curation.standing():
            if edit.verb == RELABEL and edit.bag == name and datetime.fromisoformat(edit.time) > written:
                name = edit.to
        return curation.folder / name


def _bag(path: Path, where: str, stroke: Mapping[str, Any]) -> Path:
    if "bag" not in stroke:
        raise UserError(f"{path}: {where}: {stroke} names no bag; only strokes of bags can be relabelled")
    return Path(stroke["bag"]).resolve()
