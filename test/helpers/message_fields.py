"""Messages of ROS by the names of their types, and the fields that a path through them leads to."""

from __future__ import annotations

import importlib
import json
import re
from typing import Any

STEP = re.compile(r"""\.(?P<field>\w+)|\[(?P<place>\d+|:)\]|\{(?P<key>\w+)==(?P<value>"[^"]*"|\d+)\}""")
ARRAY = re.compile(r"sequence<(?P<of>[^,>]+)(, \d+)?>|(?P<fixed>[\w/]+)\[\d+\]")


def message_class(type_name: str) -> Any:
    """The class of a message, such as ``std_msgs/msg/Header``."""
    package, kind, name = type_name.split("/")
    assert kind == "msg", type_name
    return getattr(importlib.import_module(f"{package}.msg"), name)


def fields_of(type_name: str) -> dict[str, str]:
    """Type of each field, as ``package/Name`` or a primitive."""
    return dict(message_class(type_name).get_fields_and_field_types())


def follow(type_name: str, path: str) -> str:
    """The type at the end of a path such as ``.status[:]{name=="rally"}.message``.

    Raises
    ------
    AssertionError
        If the path leads nowhere; says where it stops.
    """
    place, here = 0, type_name
    while place < len(path):
        step = STEP.match(path, place)
        assert step, f"{path}: {path[place:]!r} is no step"
        if step["field"]:
            fields = _fields_here(here, path)
            assert step["field"] in fields, f"{path}: {here} has no field {step['field']}"
            here = fields[step["field"]]
        elif step["place"]:
            array = ARRAY.fullmatch(here)
            assert array, f"{path}: {here} is no array"
            here = array["of"] or array["fixed"]
        else:
            kind = _fields_here(here, path).get(step["key"])
            assert kind, f"{path}: {here} has no field {step['key']}"
            assert isinstance(json.loads(step["value"]), str) == (kind == "string"), path
        place = step.end()
    return here


def _fields_here(here: str, path: str) -> dict[str, str]:
    assert "/" in here, f"{path}: {here} has no fields"
    return fields_of(full_name(here))


def full_name(type_name: str) -> str:
    """A type as messages name those of their fields, with its ``msg``."""
    return type_name if "/msg/" in type_name else type_name.replace("/", "/msg/")
