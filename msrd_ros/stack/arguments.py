"""Arguments of what is started, written key:=value as ROS writes them; nothing but the standard library."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from msrd_ros.core.errors import UserError

Value = str | int | float | bool | list[str]

_NAMESPACE = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*")
_TRUTHS = {"true": True, "false": False}


def as_text(text: str) -> Value:
    """Any text."""
    return text


def as_truth(text: str) -> Value:
    """True or false."""
    if text.lower() not in _TRUTHS:
        raise UserError("give true or false")
    return _TRUTHS[text.lower()]


def as_count(low: int) -> Callable[[str], Value]:
    """A whole number from `low` on."""

    def read(text: str) -> Value:
        if not re.fullmatch(r"\d+", text, re.ASCII) or int(text) < low:
            raise UserError(f"give a whole number from {low} on")
        return int(text)

    return read


def as_names(text: str) -> Value:
    """Names with commas between them."""
    names = [name.strip() for name in text.strip("[]").split(",")]
    if not all(names):
        raise UserError("give names with commas between them, such as one,another")
    return names


def as_namespace(text: str) -> Value:
    """A namespace, with a slash in front; empty for the root."""
    name = text.strip("/")
    if name and not _NAMESPACE.fullmatch(name):
        raise UserError("give letters, digits and _ with / between them, such as /left")
    return f"/{name}" if name else ""


def as_file(text: str) -> Value:
    """A file that is there."""
    path = Path(text).expanduser()
    if not path.is_file():
        raise UserError("there is no such file")
    return str(path)


def as_path(text: str) -> Value:
    """A path."""
    return str(Path(text).expanduser())


@dataclass(frozen=True)
class Argument:
    """One argument.

    Attributes
    ----------
    name, text
        What it is called, and what it is good for.
    default
        As it would be written; empty leaves the matter to the nodes and to `params_file`.
    unset
        What holds where it is empty.
    choices
        What may be said; anything that `read` takes if empty.
    read
        Makes a value of the text, or raises a `UserError` that says what is allowed.
    """

    name: str
    text: str
    default: str = ""
    unset: str = ""
    choices: tuple[str, ...] = ()
    read: Callable[[str], Value] = as_text

    @property
    def description(self) -> str:
        """What it is good for, what may be said and what holds where nothing is."""
        choices = f" One of: {', '.join(self.choices)}." if self.choices else ""
        unset = f" Empty: {self.unset}." if self.unset else ""
        return f"{self.text}.{choices}{unset}"

    def value(self, text: str, owner: str) -> Value | None:
        """Value of a text; None for an empty one.

        Raises
        ------
        UserError
            If it is not allowed; says what is.
        """
        if not text:
            return None
        if self.choices and text not in self.choices:
            raise UserError(f"{owner} {self.name}:={text}: give one of {', '.join(self.choices)}")
        try:
            return self.read(text)
        except UserError as error:
            raise UserError(f"{owner} {self.name}:={text}: {error}") from None


class Values(Mapping[str, Value]):
    """What was said of a set's arguments and what else they stand at; the empty ones are not in it."""

    def __init__(self, values: Mapping[str, Value]) -> None:
        self._values = dict(values)

    def __getitem__(self, name: str) -> Value:
        return self._values[name]

    def __iter__(self) -> Iterable[str]:  # type: ignore[override]
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def text(self, name: str) -> str:
        """As text; empty where nothing is said."""
        return str(self._values.get(name, ""))

    def number(self, name: str) -> int:
        """As a number; of an argument that has one."""
        value = self._values[name]
        assert isinstance(value, int)
        return value

    def pick(self, *same: str, **arguments: str) -> dict[str, Value]:
        """Parameters of a node, each from the argument of the same name or of the one that is named for it.

        As far as something is said.
        """
        arguments = {**{name: name for name in same}, **arguments}
        return {
            parameter: self._values[argument]
            for parameter, argument in arguments.items()
            if argument in self._values
        }


def read_values(owner: str, arguments: tuple[Argument, ...], texts: Mapping[str, str]) -> Values:
    """Values of arguments.

    Parameters
    ----------
    owner
        Whose arguments they are, for messages.
    arguments
        What there is.
    texts
        What was said, by name; all others are at their defaults.

    Raises
    ------
    UserError
        If one of them does not exist or is not allowed; says what is.
    """
    known = [argument.name for argument in arguments]
    for name in texts:
        if name not in known:
            raise UserError(f"{owner} has no argument {name!r}; it takes {', '.join(known)}")
    values = {
        argument.name: argument.value(texts.get(argument.name, argument.default), owner)
        for argument in arguments
    }
    return Values({name: value for name, value in values.items() if value is not None})


def split_words(owner: str, words: Iterable[str]) -> dict[str, str]:
    """Names and texts of words key:=value.

    Raises
    ------
    UserError
        If a word is none, or a name is there twice.
    """
    texts: dict[str, str] = {}
    for word in words:
        name, is_pair, text = word.partition(":=")
        if not is_pair:
            raise UserError(f"{owner}: {word!r} is no argument; write name:=value, and see --help")
        if name in texts:
            raise UserError(f"{owner}: {name} is given twice")
        texts[name] = text
    return texts
