"""Wheel and source distribution, each in an environment that has nothing but what they ask for."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from builds import BareEnvironment
from processes import CHECKOUT, PACKAGE

pytestmark = pytest.mark.slow

READ_BAGS = f"""
from {PACKAGE}.bags.reader import Bag
from {PACKAGE}.core.resources import shipped_bags
from {PACKAGE}.recordings.episodes import read_episodes
from {PACKAGE}.recordings.library import BagLibrary
library = BagLibrary.scan(shipped_bags())
print(len(library.bags), sum(len(read_episodes(Bag(bag.path))) for bag in library.bags[:3]))
"""
USE_LIBRARY = f"""
import {PACKAGE}.learning as msrd
print(all(getattr(msrd, name) is not None for name in msrd.__all__), len(msrd.__all__) > 5)
"""


@pytest.fixture(scope="module")
def distributions(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `make dist` builds: the wheel is made from the source distribution."""
    out = tmp_path_factory.mktemp("dist")
    subprocess.run(
        [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), str(source)],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return out


@pytest.fixture(scope="module", params=["*.whl", "*.tar.gz"])
def environment(
    request: pytest.FixtureRequest, distributions: Path, tmp_path_factory: pytest.TempPathFactory
) -> BareEnvironment:
    """An environment with one of the two, and its dependencies without extras."""
    (found,) = distributions.glob(request.param)
    return BareEnvironment(tmp_path_factory.mktemp("environment"), found)


def files_below(folder: Path) -> dict[str, bytes]:
    """Contents of all files below a folder but compiled ones, by relative path."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def test_all_files_are_inside(environment: BareEnvironment, source: Path) -> None:
    share = environment.prefix / "share" / PACKAGE
    for folder in ("config", "launch", "bags"):
        assert files_below(share / folder) == files_below(source / folder), folder
    assert (share / "package.xml").read_bytes() == (source / "package.xml").read_bytes()
    (package,) = environment.prefix.glob(f"lib/python*/site-packages/{PACKAGE}")
    assert files_below(package) == files_below(source / PACKAGE)
    executables = {path.name for path in (environment.prefix / "lib" / PACKAGE).iterdir()}
    assert executables == {path.name for path in (CHECKOUT / "scripts").iterdir() if not path.suffix} - {
        "__pycache__"
    }


def test_the_command_says_what_there_is_and_what_is_missing(environment: BareEnvironment) -> None:
    assert "simulator" in environment.run(PACKAGE, "--help")
    said = environment.run(PACKAGE, "simulator", code=2)
    assert said.splitlines()[-1].endswith(f"pip install '{PACKAGE}[ros,sim]'")


def test_library_works(environment: BareEnvironment) -> None:
    assert environment.run("python", "-c", USE_LIBRARY) == "True True"


def test_shipped_bags_are_read(environment: BareEnvironment, source: Path) -> None:
    bags = len(list((source / "bags").rglob("metadata.yaml")))
    assert bags > 3
    assert environment.run("python", "-c", READ_BAGS) == f"{bags} 3"
