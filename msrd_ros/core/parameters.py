"""Parameters as data: dataclass fields that know their description, unit and range."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class ParameterFacts:
    """What a user is told about a parameter, and what is refused.

    Attributes
    ----------
    former
        The name that it had in earlier versions; still understood, with a warning.
    """

    description: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    former: str = ""

    @property
    def text(self) -> str:
        """Description with unit and choices, as `ros2 param describe` shows it."""
        unit = f" [{self.unit}]" if self.unit else ""
        choices = f" One of: {', '.join(self.choices)}." if self.choices else ""
        return f"{self.description}{unit}{choices}"


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
    former: str = "",
) -> Any:
    """Declare a dataclass field that becomes a ROS parameter of the same name."""
    facts = ParameterFacts(description, unit, low, high, choices, former)
    if isinstance(default, list):
        return field(default_factory=lambda: list(default), metadata={"parameter": facts})
    return field(default=default, metadata={"parameter": facts})
