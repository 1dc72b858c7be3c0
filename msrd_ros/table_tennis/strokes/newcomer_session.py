"""Strokes of further teachers as bags, taken one by one into a learned result, and a journal of them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import StrategyLabel, say_label
from msrd_ros.core.errors import UserError
from msrd_ros.core.files import write_atomically
from msrd_ros.core.formats import FIRST_FORMAT, FORMAT_KEY, require_format
from msrd_ros.learning.newcomers.newcomers import Meeting
from msrd_ros.table_tennis.strokes.description import Description, met_side
from msrd_ros.table_tennis.strokes.newcomers import StrokeNewcomers
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from msrd_ros.table_tennis.strokes.training import POLICIES_FILE

JOURNAL_FILE = "newcomers.json"


@dataclass(frozen=True)
class Taken:
    """What came of one bag.

    Attributes
    ----------
    bag
        Its path.
    label
        What its recorder says that it shows, if anything.
    meeting
        What it was recognised as, and what plays it now.
    does
        What the stroke did with the ball.
    """

    bag: Path
    label: StrategyLabel | None
    meeting: Meeting
    does: Description

    def __str__(self) -> str:
        """One line for people."""
        shown = f"{self.bag.name} ({say_label(self.label)}; {self.does})"
        return f"{shown}: {self.meeting.recognition}; played as {self.meeting.name}"

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "bag": str(self.bag),
            "label": self.label and str(self.label),
            "plays": self.meeting.name,
            "episodes": self.meeting.episodes,
            "recognition": self.meeting.recognition.to_dict(),
            "does": self.does.to_json(),
        }


class NewcomerSession:
    """Takes bags, and keeps policies and journal in a folder.

    Parameters
    ----------
    newcomers
        The learned result; what was learned of stays as it is.
    out
        Folder of `POLICIES_FILE` and `JOURNAL_FILE`.
    read
        Gives the accepted strokes of a bag, one at least, labelled or not.
    """

    def __init__(
        self, newcomers: StrokeNewcomers, out: Path, read: Callable[[Path], Sequence[Episode]]
    ) -> None:
        self.newcomers = newcomers
        self._out, self._read_bag = out, read
        self._taken: list[dict[str, Any]] = []

    @property
    def policies(self) -> StrokePolicies:
        """All that can be played now."""
        return self.newcomers.stroke_policies

    @property
    def journal(self) -> Path:
        """Which bags were taken, and what came of each."""
        return self._out / JOURNAL_FILE

    def take(self, bag: Path) -> Taken:
        """Recognise the stroke in a bag, learn it if nobody knows it, and write policies and journal.

        Raises
        ------
        UserError
            If the bag cannot be read, is refused, or holds several strategies; everything stays as it is.
        """
        episodes = self._read(bag)
        taken = self._meet(bag, episodes)
        self._taken.append(taken.to_dict())
        write_atomically(self._out / POLICIES_FILE, self.policies.to_bytes())
        content = {FORMAT_KEY: FIRST_FORMAT, "bags": self._taken}
        write_atomically(self.journal, (json.dumps(content, indent=2) + "\n").encode())
        return taken

    def take_again(self) -> Iterator[Taken | UserError]:
        """Take the bags of a journal that is there already, in their order; yields what came of each.

        A bag that is not to be had any more is left out.

        Raises
        ------
        UserError
            If the journal is damaged, or of a newer version.
        """
        for bag in read_journal(self.journal):
            try:
                yield self.take(bag)
            except UserError as error:
                yield error

    def _read(self, bag: Path) -> Sequence[Episode]:
        if not bag.exists():
            raise UserError(
                f"bag {bag}: is not on this machine; run the trainer where the recorder writes, or share its "
                "folder"
            )
        episodes = self._read_bag(bag)
        if len({episode.label for episode in episodes}) > 1:
            raise UserError(f"bag {bag}: shows several strategies; give one bag for each")
        return episodes

    def _meet(self, bag: Path, episodes: Sequence[Episode]) -> Taken:
        label = episodes[0].label
        meeting = self.newcomers.meet_strokes(episodes, label)
        outcomes = [episode.outcome for episode in episodes if episode.outcome is not None]
        return Taken(bag, label, meeting, Description.of(met_side(episodes), outcomes))


def read_journal(path: Path) -> list[Path]:
    """The bags in a journal, in their order; none if there is no journal.

    Raises
    ------
    UserError
        If it cannot be read.
    """
    if not path.exists():
        return []
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        require_format(content[FORMAT_KEY], FIRST_FORMAT, str(path))
        return [Path(taken["bag"]) for taken in content["bags"]]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UserError(
            f"{path}: damaged journal ({error}); move it away to begin without newcomers"
        ) from None
