"""What a page may ask for: words and numbers, held against what is allowed."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

from msrd_ros.core.errors import UserError


class Request:
    """One message of a page.

    Parameters
    ----------
    content
        As it came: ``do`` says what, ``id`` is repeated in the answer, everything else are its values.
    browser
        Number of the browser whose page it is.

    Attributes
    ----------
    verb, number
        What is to be done, and how the page knows the answer.
    """

    def __init__(self, content: Mapping[str, Any], browser: int = 0) -> None:
        self._content, self.browser = content, browser
        self.verb = str(content.get("do", ""))
        number = content.get("id")
        self.number = number if isinstance(number, int | str) else None

    def text(self, name: str, most: int = 1000) -> str:
        """A text.

        Raises
        ------
        UserError
            If it is none, or longer than `most`.
        """
        value = self._content.get(name, "")
        if not isinstance(value, str) or len(value) > most:
            raise UserError(f"{self.verb}: {name} is no text of at most {most} letters")
        return value

    def texts(self, name: str, most: int, fewest: int = 1) -> list[str]:
        """Some texts.

        Raises
        ------
        UserError
            If they are none, fewer than `fewest`, or more than `most`.
        """
        value = self._content.get(name)
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise UserError(f"{self.verb}: {name} is no list of texts")
        if not fewest <= len(value) <= most:
            raise UserError(f"{self.verb}: {len(value)} of {name} are chosen; choose {fewest} to {most}")
        return value

    def choice(self, name: str, choices: Collection[str]) -> str:
        """One of some texts.

        Raises
        ------
        UserError
            If it is another one; lists them.
        """
        value = self.text(name)
        if value not in choices:
            raise UserError(f"{self.verb}: {name} {value!r} is unknown; use one of {', '.join(choices)}")
        return value

    def flag(self, name: str) -> bool:
        """True or false.

        Raises
        ------
        UserError
            If it is neither.
        """
        value = self._content.get(name)
        if not isinstance(value, bool):
            raise UserError(f"{self.verb}: {name} is {value!r}; give true or false")
        return value

    def within(self, name: str, low: float, high: float, unit: str = "") -> float:
        """A number.

        Raises
        ------
        UserError
            If it is none, or out of range; names the range.
        """
        value = self._content.get(name)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise UserError(
                f"{self.verb}: {name} is {value!r}; give a number from {low:g} to {high:g} {unit}"
            )
        if not low <= value <= high:
            raise UserError(f"{self.verb}: {name} is {value:g}; give {low:g} to {high:g} {unit}".rstrip())
        return float(value)

    def whole(self, name: str, low: int, high: int) -> int:
        """A whole number.

        Raises
        ------
        UserError
            If it is none, or out of range; names the range.
        """
        value = self.within(name, low, high)
        if value != int(value):
            raise UserError(f"{self.verb}: {name} is {value:g}; give a whole number from {low} to {high}")
        return int(value)
