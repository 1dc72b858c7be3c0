"""The package finds its own files in a checkout, under a prefix and through the ament index."""

from __future__ import annotations

from pathlib import Path

import pytest

from msrd_ros.core import resources
from msrd_ros.core.errors import UserError
from processes import CHECKOUT

MARKER = "share/ament_index/resource_index/packages/msrd_ros"


@pytest.fixture(autouse=True)
def nowhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """No ament index in the environment, and no installation under Python's own prefix."""
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    monkeypatch.setattr("sys.prefix", str(tmp_path / "python"))


def pretend_code_is_under(library: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = library / "msrd_ros" / "core" / "resources.py"
    module.parent.mkdir(parents=True)
    module.touch()
    monkeypatch.setattr(resources, "__file__", str(module))


def install_share_under(prefix: Path) -> Path:
    (prefix / MARKER).parent.mkdir(parents=True)
    (prefix / MARKER).touch()
    share = prefix / "share" / "msrd_ros"
    share.mkdir()
    return share


def test_checkout_uses_its_own_files_even_beside_an_installed_copy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install_share_under(tmp_path / "installed")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "installed"))
    assert resources.share_directory() == CHECKOUT


@pytest.mark.parametrize("library", ["lib/python3.12/site-packages", "local/lib/python3.12/dist-packages"])
def test_installed_code_finds_its_prefix_without_the_index(
    library: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    share = install_share_under(tmp_path)
    pretend_code_is_under(tmp_path / library, monkeypatch)
    assert resources.share_directory() == share


def test_ament_index_is_searched_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pretend_code_is_under(tmp_path / "elsewhere", monkeypatch)
    share = install_share_under(tmp_path / "second")
    install_share_under(tmp_path / "third")
    paths = [tmp_path / "first", tmp_path / "second", tmp_path / "third"]
    monkeypatch.setenv("AMENT_PREFIX_PATH", ":".join(str(path) for path in paths))
    assert resources.share_directory() == share


def test_pythons_prefix_comes_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pretend_code_is_under(tmp_path / "elsewhere", monkeypatch)
    assert install_share_under(tmp_path / "python") == resources.share_directory()


def test_nothing_found_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pretend_code_is_under(tmp_path / "elsewhere", monkeypatch)
    with pytest.raises(UserError, match=r"pip install \."):
        resources.share_directory()


def test_missing_bags_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pretend_code_is_under(tmp_path / "lib", monkeypatch)
    share = install_share_under(tmp_path)
    with pytest.raises(UserError, match="bags"):
        resources.shipped_bags()
    (share / "bags").mkdir()
    assert resources.shipped_bags() == share / "bags"
