"""Strokes of which nobody has said whose they are, sorted into strategies that a person recognises."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from msrd_ros.contract.episode import ACTING_STEPS, FIRST_ACTING_STEP, Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.files import write_atomically
from msrd_ros.learning.discovery.discover import discover
from msrd_ros.learning.discovery.recheck import recheck
from msrd_ros.learning.discovery.result import Discovery
from msrd_ros.learning.learned import Learned
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.table_tennis.strokes.description import Description, met_side

STRATEGIES_FILE = "strategies.json"


@dataclass(frozen=True)
class SortedStrokes:
    """Strokes under the strategies that were found in them.

    Attributes
    ----------
    episodes
        As they came, each with the name of its strategy as its label.
    discovery
        What was found, with beliefs; its sources are the episodes' bags.
    """

    episodes: list[Episode]
    discovery: Discovery

    def descriptions(self) -> dict[str, Description]:
        """What each strategy does with the ball, by name."""
        groups = {
            name: [episode for episode in self.episodes if episode.label == name]
            for name in self.discovery.names
        }
        return {
            name: Description.of(met_side(own), [e.outcome for e in own if e.outcome is not None])
            for name, own in groups.items()
        }

    def account(self) -> list[str]:
        """For people: each strategy with what it does, then each label that is doubted."""
        found = self.discovery
        sizes = {name: found.labels.count(name) for name in found.names}
        lines = [f"{name} ({sizes[name]} strokes): {text}" for name, text in self.descriptions().items()]
        return lines + [
            f"{found.sources[number]}: says {found.given[number]}, but is rather {found.labels[number]}"
            for number in found.doubted
        ]

    def recheck(self, learned: Learned, demonstrations: Demonstrations) -> dict[str, Any]:
        """Whether learned policies and rewards agree with what was found, as data for JSON.

        What `Recheck.to_dict` says, strokes that both take for another strategy (``moved``) by their bags.

        Parameters
        ----------
        learned
            From these strokes.
        demonstrations
            As `gather_demonstrations` makes them of `episodes`.

        Raises
        ------
        UserError
            If something else was learned.
        """
        told = recheck(learned, demonstrations).to_dict()
        order = [
            episode.source.removeprefix("bag ")
            for label in demonstrations.layout.labels
            for episode in self.episodes
            if episode.label == label
        ]
        moved = [{"bag": order[one["index"]], "strategy": one["strategy"]} for one in told["moved"]]
        return {**told, "moved": moved}

    def save(self, out: Path) -> None:
        """Write `STRATEGIES_FILE` into a folder: what `Discovery.to_dict` says, and what the strategies do.

        Raises
        ------
        UserError
            If it cannot be written.
        """
        does = {name: description.to_json() for name, description in self.descriptions().items()}
        content = {**self.discovery.to_dict(), "does": does}
        write_atomically(out / STRATEGIES_FILE, (json.dumps(content, indent=2) + "\n").encode())


def sort_strokes(episodes: Sequence[Episode], seed: int) -> SortedStrokes:
    """Find the strategies of strokes; labels that some have are taken for right as far as they prove to be.

    Parameters
    ----------
    episodes
        Of one robot, with labels, without, or with wrong ones.
    seed
        Everything random follows from it.

    Raises
    ------
    UserError
        If there is one stroke only.
    """
    last = FIRST_ACTING_STEP + ACTING_STEPS
    found = discover(
        [episode.observations[FIRST_ACTING_STEP : last + 1] for episode in episodes],
        [episode.actions[FIRST_ACTING_STEP:last] for episode in episodes],
        [episode.label for episode in episodes],
        [episode.source.removeprefix("bag ") for episode in episodes],
        seed,
    )
    named = [
        replace(episode, label=StrategyLabel(name))
        for episode, name in zip(episodes, found.labels, strict=True)
    ]
    return SortedStrokes(named, found)


def describe_recheck(told: Mapping[str, Any]) -> str:
    """What `SortedStrokes.recheck` says, for people."""
    lines = [
        f"of {told['of']} strokes {told['agree_by_policies']} are likeliest under the policy of the strategy "
        f"that was found for them, and {told['agree_by_rewards']} stand out most in its reward",
        *(f"{one['bag']} is rather {one['strategy']} by both" for one in told["moved"]),
    ]
    return "; ".join(lines)
