"""Where work is done, as users say it: an address counts only where it was given."""

from __future__ import annotations

import sys

import pytest

from msrd_ros.cluster.on_ray import ADDRESS_VARIABLE
from msrd_ros.cluster.places import Place
from msrd_ros.cluster.processes import Processes, ThisProcess
from msrd_ros.core.errors import UserError


@pytest.mark.parametrize(
    ("said", "variable", "uses_ray", "address"),
    [
        ("local", None, False, None),
        ("local", "10.0.0.1:6379", False, None),
        ("ray", None, True, None),
        ("ray", "", True, None),
        ("ray", "10.0.0.1:6379", True, "10.0.0.1:6379"),
        ("ray://head:10001", None, True, "ray://head:10001"),
        ("ray://head:10001", "10.0.0.1:6379", True, "ray://head:10001"),
    ],
)
def test_what_is_said_is_what_is_meant(
    said: str, variable: str | None, uses_ray: bool, address: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(ADDRESS_VARIABLE, raising=False)
    if variable is not None:
        monkeypatch.setenv(ADDRESS_VARIABLE, variable)
    assert Place.parse(said, "--on") == Place(uses_ray, address)


@pytest.mark.parametrize(
    "said", ["", "Ray", "cluster", "ray://", "ray://head", "ray://head:port", "head:6379"]
)
def test_anything_else_is_refused_by_name(said: str) -> None:
    with pytest.raises(UserError, match=f"--on {said}: say local, ray or ray://HOST:PORT"):
        Place.parse(said, "--on")


def test_local_is_processes_and_without_any_this_one() -> None:
    for count, kind in ((0, ThisProcess), (3, Processes)):
        with Place().open(count) as workers:
            assert isinstance(workers, kind)
            assert workers.slots() == max(count, 1)


def test_without_ray_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(UserError, match=r"pip install 'msrd_ros\[ray\]'"):
        Place.parse("ray", "--on").open()
