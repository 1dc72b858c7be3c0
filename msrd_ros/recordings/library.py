"""A folder of bags: what is there, what is refused, and which of it is wanted."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from msrd_ros.bags.finding import find_bags, require_bags_at
from msrd_ros.bags.info import BagInfo, read_info
from msrd_ros.contract.labels import UNLABELLED, StrategyLabel
from msrd_ros.core.errors import UserError


@dataclass(frozen=True)
class BagLibrary:
    """The bags below one or several folders, by their metadata alone.

    Attributes
    ----------
    bags
        Sound bags, in the order of their paths.
    refused
        One line for every bag that is not: it names the bag and says what to do.
    """

    bags: tuple[BagInfo, ...]
    refused: tuple[str, ...] = ()

    @classmethod
    def scan(cls, *roots: Path | str, strict: bool = False) -> BagLibrary:
        """Find the bags of folders; a folder may itself be a bag, or an MCAP file. Each bag counts once.

        Parameters
        ----------
        roots
            Where to look; hidden directories are passed over, links followed.
        strict
            Refuse a folder with one broken bag, instead of listing it in `refused`.

        Raises
        ------
        UserError
            If a folder does not exist or holds no bag at all; with `strict`, if any bag is broken.
        """
        bags: list[BagInfo] = []
        refused: list[str] = []
        seen: set[str] = set()
        for root in map(Path, roots):
            require_bags_at(root, f"folder {root}")
            known = len(seen)
            found = find_bags(root, seen)
            for path in found:
                try:
                    bags.append(read_info(path))
                except UserError as error:
                    if strict:
                        raise
                    refused.append(str(error))
            if not found and (not known or len(seen) > known):
                raise UserError(
                    f"folder {root}: holds no bags; record some with the recorder, or give another folder"
                )
        return cls(tuple(bags), tuple(refused))

    def select(
        self,
        labels: Collection[StrategyLabel | None] = (),
        subjects: Collection[str] = (),
        kept_only: bool = True,
    ) -> tuple[BagInfo, ...]:
        """The bags of some labels and subjects; of all where none are given.

        Parameters
        ----------
        labels
            None among them stands for bags that say they have none. Bags that do not say anything of their
            label (foreign ones) are only in when this is empty.
        subjects
            Names of subjects.
        kept_only
            Leave out strokes that the recorder had refused and kept all the same.

        Raises
        ------
        UserError
            If nothing is left; says what there is.
        """
        chosen = tuple(
            bag
            for bag in self.bags
            if (not labels or (bag.label in labels and (bag.label is not None or bag.unlabelled)))
            and (not subjects or bag.subject in subjects)
            and (bag.kept or not kept_only)
        )
        if not chosen:
            raise UserError(f"no bag fits the selection; {self._contents()}")
        return chosen

    def _contents(self) -> str:
        labels = sorted({str(bag.label) for bag in self.bags if bag.label})
        labels += [UNLABELLED] * any(bag.unlabelled for bag in self.bags)
        subjects = sorted({bag.subject for bag in self.bags if bag.subject})
        refused = f", and {len(self.refused)} that cannot be read: {self.refused[0]}" if self.refused else ""
        return (
            f"there are {len(self.bags)} bags with labels {', '.join(labels) or 'none'} "
            f"and subjects {', '.join(subjects) or 'none'}{refused}"
        )
