"""Versions of formats: older files are read, newer ones refused by name with what to do."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from msrd_ros.core.errors import UserError
from msrd_ros.core.formats import read_report, require_format, write_report

EARLIER = Path(__file__).parents[1] / "data" / "0.1.0"


@pytest.mark.parametrize("found", [1, 2, "1", "2"])
def test_versions_up_to_the_newest_are_read(found: object) -> None:
    require_format(found, 2, "file")


@pytest.mark.parametrize("found", [3, "3", 10**8])
def test_newer_versions_are_refused_with_what_to_do(found: object) -> None:
    with pytest.raises(UserError, match=rf"file: is of format {found}, .* reads up to 2; upgrade msrd_ros"):
        require_format(found, 2, "file")


@pytest.mark.parametrize("found", [None, 0, -1, 1.5, True, "", "one", "²", "9" * 5000, [1]])
def test_what_is_no_version_is_refused(found: object) -> None:
    with pytest.raises(UserError, match=r"file: format .* is no version"):
        require_format(found, 2, "file")


def test_reports_read_back_and_say_their_format(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    write_report(path, {"seed": 3, "labels": {"forehand-push": {"fed": 2}}})
    assert read_report(path) == {"seed": 3, "labels": {"forehand-push": {"fed": 2}}}
    content = json.loads(path.read_text())
    assert content.pop("format") == 1
    path.write_text(json.dumps({**content, "format": 2}))
    with pytest.raises(UserError, match=r"report\.json: is of format 2"):
        read_report(path)


def test_reports_of_0_1_0_are_read_under_present_names() -> None:
    training, rates = (read_report(EARLIER / name) for name in ("training.json", "rates.json"))
    assert training["iterations"] == training["config"]["iterations"] == 2
    assert [point["iteration"] for point in training["curve"]] == [0, 1, 2]
    assert list(rates["labels"]) == training["labels"]
    assert all(row["fed"] == 2 for row in rates["labels"].values())


@pytest.mark.parametrize("text", ["", "{", "[1]", "7", '{"format": null}'])
def test_other_files_are_no_reports(tmp_path: Path, text: str) -> None:
    (tmp_path / "report.json").write_text(text)
    with pytest.raises(UserError, match=r"report\.json: "):
        read_report(tmp_path / "report.json")


def test_a_report_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"gone\.json: no readable report"):
        read_report(tmp_path / "gone.json")
