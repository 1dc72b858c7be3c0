"""Reading a sheet of numbers and names (YAML), with refusals that name file and key."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.core.formats import FIRST_FORMAT, FORMAT_KEY, require_format

Array = NDArray[np.float64]

SHEET_FORMAT = 1


def constant(values: Any) -> Array:
    """Numbers as an array that nobody can write to."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


class Sheet:
    """A YAML file of numbers and names, every key of which is asked for once.

    Parameters
    ----------
    path
        Of the file, for errors.
    values
        What it holds, or what it holds under a key.
    under
        That key, for errors.
    """

    def __init__(self, path: Path, values: dict[str, Any], under: str = "") -> None:
        self.path = path
        self._values = values
        self._under = f"{under}." if under else ""
        self._asked: set[str] = set()

    @classmethod
    def read(cls, path: Path) -> Sheet:
        """Read a file.

        Raises
        ------
        UserError
            If it is not YAML, no table of keys, or of a newer format.
        """
        try:
            values = yaml.safe_load(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise UserError(f"{path}: cannot be read ({error.strerror})") from None
        except (yaml.YAMLError, UnicodeDecodeError) as error:
            raise UserError(f"{path}: is not YAML ({str(error).splitlines()[0]}); correct it") from None
        if not isinstance(values, dict):
            raise UserError(f"{path}: holds no keys; see config/robots/sawyer/robot.yaml")
        require_format(values.pop(FORMAT_KEY, FIRST_FORMAT), SHEET_FORMAT, str(path))
        return cls(path, values)

    def value(self, key: str, wanted: str) -> Any:
        """What stands under a dotted key.

        Raises
        ------
        UserError
            If nothing does.
        """
        self._asked.add(key)
        found: Any = self._values
        for part in key.split("."):
            if not isinstance(found, dict) or part not in found:
                raise UserError(f"{self._where(key)} is missing; write {wanted}")
            found = found[part]
        return found

    def text(self, key: str) -> str:
        """A name."""
        value = self.value(key, "a name")
        if not isinstance(value, str) or not value:
            raise UserError(f"{self._where(key)} is {value!r}; write a name")
        return value

    def items(self, key: str, wanted: str) -> list[Any]:
        """A list of anything."""
        value = self.value(key, f"a list of {wanted}")
        if not isinstance(value, list):
            raise UserError(f"{self._where(key)} is {value!r}; write a list of {wanted}")
        return value

    def number(self, key: str, low: float = -math.inf, high: float = math.inf) -> float:
        """A finite number."""
        return self._numbers(key, [self.value(key, "a number")], low, high)[0]

    def vector(self, key: str) -> tuple[float, float, float]:
        """Three numbers."""
        values = self.items(key, "three numbers")
        if len(values) != 3:
            raise UserError(f"{self._where(key)} has {len(values)} numbers; write three")
        x, y, z = self._numbers(key, values)
        return x, y, z

    def pose(self, key: str) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Position in m, and fixed-axis roll, pitch, yaw in rad."""
        return self.vector(f"{key}.position_m"), self.vector(f"{key}.roll_pitch_yaw_rad")

    def joints(self, key: str, names: tuple[str, ...], low: float = -math.inf) -> Array:
        """One number for each joint, shape (N,)."""
        values = self.items(key, f"{len(names)} numbers, one for each joint")
        if len(values) != len(names):
            missing = f"; nothing for {', '.join(names[len(values) :])}" if len(values) < len(names) else ""
            raise UserError(
                f"{self._where(key)} has {len(values)} numbers for {len(names)} joints{missing}; "
                "write one for each joint"
            )
        return constant(self._numbers(key, values, low, names=names))

    def require_known(self) -> None:
        """Refuse keys that nobody asked for: they would have no effect.

        Raises
        ------
        UserError
            If there is one; names it.
        """
        tops = {key.partition(".")[0] for key in self._asked}
        for top, inner in self._values.items():
            keys = [f"{top}.{name}" for name in inner] if isinstance(inner, dict) else [str(top)]
            for key in keys:
                if key not in self._asked and not (top in self._asked and isinstance(inner, dict)):
                    known = sorted(key for key in self._asked if key.startswith(f"{top}.")) or sorted(tops)
                    raise UserError(f"{self._where(key)} is unknown; it has {', '.join(known)}")

    def has(self, key: str) -> bool:
        """Whether an optional top-level key is there."""
        return key in self._values

    def _where(self, key: str) -> str:
        return f"{self.path}: {self._under}{key}"

    def _numbers(
        self,
        key: str,
        values: list[Any],
        low: float = -math.inf,
        high: float = math.inf,
        names: tuple[str, ...] = (),
    ) -> list[float]:
        for index, value in enumerate(values):
            where = self._where(f"{key} of joint {names[index]}" if names else key)
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise UserError(f"{where} is {value!r}; write a finite number")
            if not low <= value <= high:
                bounds = f"of at least {low:g}" if math.isinf(high) else f"from {low:g} to {high:g}"
                raise UserError(f"{where} is {value!r}; write a number {bounds}")
        return [float(value) for value in values]
