"""What the columns of observations and actions mean: checked before anything learned is used."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from msrd_ros.core.errors import UserError


@dataclass(frozen=True)
class Layout:
    """Columns of observations and actions, strategies, and how often a policy acts.

    Attributes
    ----------
    observation_names, action_names
        One name per column, in order.
    labels
        One name per strategy, in order.
    control_period_s
        Seconds between two actions.
    """

    observation_names: tuple[str, ...]
    action_names: tuple[str, ...]
    labels: tuple[str, ...]
    control_period_s: float

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Layout:
        """Inverse of `to_dict`; KeyError, TypeError or ValueError if something is missing or malformed."""
        period_s = float(data["control_period_s"])
        if not 0.0 < period_s < math.inf:
            raise ValueError(f"a control period of {period_s} s")
        return cls(
            _names(data, "observation_names"), _names(data, "action_names"), _names(data, "labels"), period_s
        )

    def require(self, wanted: Layout, where: str) -> None:
        """Refuse this layout unless it serves `wanted`.

        Columns and control period must be the same; of the labels, every wanted one must be there.

        Raises
        ------
        UserError
            Naming `where` and everything that differs.
        """
        differences = [
            *_column_differences("observations", self.observation_names, wanted.observation_names),
            *_column_differences("actions", self.action_names, wanted.action_names),
        ]
        if abs(self.control_period_s - wanted.control_period_s) > 1e-9:
            differences.append(
                f"control period {self.control_period_s} s, wanted {wanted.control_period_s} s"
            )
        missing = [label for label in wanted.labels if label not in self.labels]
        if missing:
            differences.append(f"no strategy {', '.join(missing)} (it has {', '.join(self.labels)})")
        if differences:
            raise UserError(f"{where}: does not fit: {'; '.join(differences)}; train for this layout")


def _names(data: dict[str, Any], field: str) -> tuple[str, ...]:
    names = data[field]
    if not isinstance(names, list | tuple) or not all(isinstance(name, str) for name in names):
        raise TypeError(f"{field} is no list of names")
    return tuple(names)


def _column_differences(kind: str, found: tuple[str, ...], wanted: tuple[str, ...]) -> list[str]:
    if found == wanted:
        return []
    missing = [name for name in wanted if name not in found]
    extra = [name for name in found if name not in wanted]
    parts = []
    if missing:
        parts.append(f"lacks {', '.join(missing)}")
    if extra:
        parts.append(f"has {', '.join(extra)} too many")
    return [f"{kind}: {' and '.join(parts) if parts else 'same columns in another order'}"]
