"""Names that change places in one step."""

from __future__ import annotations

from pathlib import Path

import pytest

from msrd_ros.core.files import exchange


def test_two_names_change_places(tmp_path: Path) -> None:
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "file").write_text(name, encoding="utf-8")
    exchange(tmp_path / "one", tmp_path / "other")
    assert (tmp_path / "one" / "file").read_text(encoding="utf-8") == "other"
    assert (tmp_path / "other" / "file").read_text(encoding="utf-8") == "one"


def test_where_there_is_nothing_it_fails_and_leaves_the_other(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    with pytest.raises(FileNotFoundError):
        exchange(tmp_path / "one", tmp_path / "other")
    assert (tmp_path / "one").is_dir()
