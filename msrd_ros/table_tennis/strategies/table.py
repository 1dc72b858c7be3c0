"""The table of strategies: what is known of each beside its name, read from ``config/strategies.yaml``.

A strategy that the table does not list can be recorded, trained and played as well; then its side follows
from where its demonstrations met the ball, nobody judges its spin, and its colour follows from its name.
"""

from __future__ import annotations

import colorsys
import hashlib
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.core.formats import FIRST_FORMAT, FORMAT_KEY, require_format
from msrd_ros.core.resources import share_directory

STRATEGIES_FORMAT = 1

_KEYS = frozenset({"side", "stroke", "description", "spin_rad_s", "colour"})
_COLOUR = re.compile(r"#[0-9a-fA-F]{6}")


class Side(StrEnum):
    """Side of the paddle that meets the ball."""

    FOREHAND = "forehand"
    BACKHAND = "backhand"

    @property
    def sign(self) -> float:
        """Of y where a ball to this side arrives."""
        return -1.0 if self is Side.FOREHAND else 1.0

    @classmethod
    def at(cls, ball_y_m: float) -> Side:
        """The side that a ball comes to which is at `ball_y_m` when it meets the paddle."""
        return cls.FOREHAND if ball_y_m <= 0.0 else cls.BACKHAND


DEFAULT_SIDE = Side.FOREHAND
"""Where balls go while nothing says for which strategy they are."""

STRATEGIES_HELP = "File that lists the task's strategies; empty takes config/strategies.yaml of the package"
SIDE_HELP = "Where balls go for a strategy of which neither file nor checkpoint tells the side"
"""What users are told of the parameters `strategies` and `side`."""


class SpinRange(NamedTuple):
    """Spin about y right after the hit that a strategy is told by, rad/s; positive is topspin."""

    low: float
    high: float

    def distance(self, spin_y_rad_s: float) -> float:
        """How far a spin is outside, rad/s; 0 within."""
        return max(self.low - spin_y_rad_s, spin_y_rad_s - self.high, 0.0)


@dataclass(frozen=True)
class Strategy:
    """What is known of one strategy.

    Attributes
    ----------
    label
        Its name.
    side
        The side that is fed; None where the table does not say.
    stroke
        What it shares with its counterpart on the other side; its own name where it shares nothing.
    description
        For people.
    spin
        By which a judge tells it; None where nobody judges its spin.
    colour
        In figures, ``#rrggbb``.
    """

    label: StrategyLabel
    side: Side | None
    stroke: str
    description: str
    spin: SpinRange | None
    colour: str

    @classmethod
    def unlisted(cls, label: StrategyLabel) -> Strategy:
        """What is known of a strategy of which no table tells."""
        return cls(label, None, str(label), "", None, colour_of(label))


@dataclass(frozen=True)
class Strategies:
    """The strategies of a task, in the order of its file.

    Attributes
    ----------
    listed
        By label.
    """

    listed: Mapping[StrategyLabel, Strategy]

    @classmethod
    def read(cls, path: Path) -> Strategies:
        """Read a file; every strategy is a key with `side`, `stroke`, `description`, `spin_rad_s`, `colour`.

        Raises
        ------
        UserError
            If it cannot be read or says something that is not understood; names the file and the strategy.
        """
        try:
            content = yaml.safe_load(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
            reason = (str(error).splitlines() or [""])[0]
            raise UserError(f"strategies {path}: not readable ({reason}); mend it or name another") from None
        if not isinstance(content, dict) or not isinstance(content.get("strategies"), dict):
            raise UserError(f"strategies {path}: has no map named strategies; see config/strategies.yaml")
        require_format(content.get(FORMAT_KEY, FIRST_FORMAT), STRATEGIES_FORMAT, f"strategies {path}")
        found = [
            _read_entry(name, entry, f"strategies {path}") for name, entry in content["strategies"].items()
        ]
        return cls({strategy.label: strategy for strategy in found})

    @classmethod
    def load(cls, path: str) -> Strategies:
        """Those of a parameter `strategies`: of the file, or of the package where it is empty."""
        return cls.read(Path(path).expanduser()) if path else cls.shipped()

    @staticmethod
    def shipped() -> Strategies:
        """Those of the package's ``config/strategies.yaml``: the paper's six."""
        return _shipped()

    @property
    def labels(self) -> tuple[StrategyLabel, ...]:
        """The listed names, in order."""
        return tuple(self.listed)

    def of(self, label: StrategyLabel) -> Strategy:
        """What is known of a strategy, listed or not."""
        return self.listed.get(label) or Strategy.unlisted(label)

    def sort(self, labels: Iterable[StrategyLabel]) -> tuple[StrategyLabel, ...]:
        """Labels, each once: listed ones in the order of the file, then the others by the alphabet."""
        wanted = set(labels)
        return (*(label for label in self.listed if label in wanted), *sorted(wanted - set(self.listed)))

    def spin_is_right(self, label: StrategyLabel, spin_y_rad_s: float) -> bool | None:
        """Whether a ball's spin speaks of a strategy: no listed range is nearer; None where nobody judges it.

        In the middle between two ranges the one of less spin has it.
        """
        wanted = self.of(label).spin
        if wanted is None:
            return None
        if wanted.distance(spin_y_rad_s) == 0.0:
            return True
        nearest = min(self._ranges(), key=lambda each: (each.distance(spin_y_rad_s), _least(each)))
        return nearest == wanted

    @property
    def spin_borders(self) -> tuple[float, ...]:
        """Half-way between neighbouring ranges of spin, rad/s, rising."""
        return tuple((lower.high + upper.low) / 2 for lower, upper in pairwise(self._ranges()))

    def _ranges(self) -> list[SpinRange]:
        return sorted({strategy.spin for strategy in self.listed.values() if strategy.spin is not None})


def colour_of(label: StrategyLabel) -> str:
    """A colour that follows from the name alone, dark enough to be seen on white."""
    hue = hashlib.sha256(label.encode()).digest()[0] / 256
    red, green, blue = (round(255 * part) for part in colorsys.hls_to_rgb(hue, 0.42, 0.65))
    return f"#{red:02x}{green:02x}{blue:02x}"


def _least(spin: SpinRange) -> float:
    return min(abs(spin.low), abs(spin.high)) if spin.low * spin.high > 0.0 else 0.0


@cache
def _shipped() -> Strategies:
    return Strategies.read(share_directory() / "config" / "strategies.yaml")


def _read_entry(name: Any, entry: Any, where: str) -> Strategy:
    label = StrategyLabel.parse(str(name), where)
    where = f"{where}: {label}"
    if not isinstance(entry, dict) or not set(entry) <= _KEYS:
        raise UserError(f"{where}: give some of {', '.join(sorted(_KEYS))}, and nothing else")
    plain = Strategy.unlisted(label)
    colour = str(entry.get("colour") or plain.colour)
    if not _COLOUR.fullmatch(colour):
        raise UserError(f'{where}: colour {colour!r} is none; write it as "#0072b2"')
    return Strategy(
        label,
        _read_side(entry.get("side"), where),
        str(entry.get("stroke") or plain.stroke),
        str(entry.get("description") or ""),
        _read_spin(entry.get("spin_rad_s"), where),
        colour,
    )


def _read_side(value: Any, where: str) -> Side | None:
    try:
        return None if value is None else Side(value)
    except ValueError:
        raise UserError(f"{where}: side {value!r} is unknown; use one of {', '.join(Side)}") from None


def _read_spin(value: Any, where: str) -> SpinRange | None:
    if value is None:
        return None
    try:
        spin = SpinRange(*map(float, value))
        if not spin.low < spin.high or math.inf in (spin.low, -spin.high):
            raise ValueError
    except (TypeError, ValueError):
        raise UserError(
            f"{where}: spin_rad_s {value!r} is no range; give [lowest, highest], such as [65, .inf]"
        ) from None
    return spin
