"""Parameters as data: dataclass fields that know their description, unit and range."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from msrd_ros.core.errors import UserError

_TYPE_NAMES = {bool: "bool", int: "integer", float: "double", str: "string", list: "string array"}
"""What ROS calls the types that parameters have."""


@dataclass(frozen=True)
class ParameterFacts:
    """What a user is told about a parameter, and what is refused.

    Attributes
    ----------
    former
        The name that it had in earlier versions; still understood, with a warning.
    live
        Whether it may be set while the node runs, and then takes effect at once.
    check
        Called with a value and where it comes from; raises a `UserError` that names both if it is unfit.
    """

    description: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    former: str = ""
    live: bool = False
    check: Callable[[str, str], object] | None = None

    @property
    def text(self) -> str:
        """Description with unit and choices, as `ros2 param describe` shows it."""
        unit = f" [{self.unit}]" if self.unit else ""
        choices = f" One of: {', '.join(self.choices)}." if self.choices else ""
        return f"{self.description}{unit}{choices}"

    def require(self, value: object, default: object, where: str) -> None:
        """Refuse what a parameter must not be; the same at the start and while the node runs.

        Parameters
        ----------
        value
            What is given.
        default
            The parameter's default, whose type it must have.
        where
            For example ``parameter seed of simulator``.

        Raises
        ------
        UserError
            Names the parameter, the value and what is allowed.
        """
        if type(value) is not type(default) or (isinstance(value, list) and not _are_texts(value)):
            raise UserError(
                f"{where}: {value!r} has the wrong type; give {_TYPE_NAMES[type(default)]}, "
                f"such as {default!r}"
            )
        if isinstance(value, int | float) and not isinstance(value, bool) and not self._is_within(value):
            raise UserError(f"{where}: {value!r} is out of range; give {self._range}")
        if self.choices and value not in self.choices:
            raise UserError(f"{where}: {value!r} is unknown; use one of {', '.join(self.choices)}")
        if self.check is not None:
            self.check(str(value), where)

    def _is_within(self, value: float) -> bool:
        low = -math.inf if self.low is None else self.low
        high = math.inf if self.high is None else self.high
        return low <= value <= high and math.isfinite(value)

    @property
    def _range(self) -> str:
        if self.low is None and self.high is None:
            return "a finite number"
        if self.high is None:
            text = f"at least {self.low}"
        elif self.low is None:
            text = f"at most {self.high}"
        else:
            text = f"a value from {self.low} to {self.high}"
        return f"{text} {self.unit}".rstrip()


def _are_texts(values: list[object]) -> bool:
    return all(isinstance(value, str) for value in values)


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
    former: str = "",
    live: bool = False,
    check: Callable[[str, str], object] | None = None,
) -> Any:
    """Declare a dataclass field that becomes a ROS parameter of the same name."""
    facts = ParameterFacts(description, unit, low, high, choices, former, live, check)
    if isinstance(default, list):
        return field(default_factory=lambda: list(default), metadata={"parameter": facts})
    return field(default=default, metadata={"parameter": facts})
