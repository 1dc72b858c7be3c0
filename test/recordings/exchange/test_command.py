"""The verbs `export` and `import` of `python -m msrd_ros.bags`."""

from __future__ import annotations

from pathlib import Path

import pytest

from exchanged_bags import DAMAGED, REFUSED, STROKES, mixed_folder
from libraries import contents
from msrd_ros.recordings.command import main


def test_bags_go_out_and_come_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bags, data_set, back = mixed_folder(tmp_path / "bags"), tmp_path / "set", tmp_path / "back"
    assert main(["export", "--to", "lerobot", str(bags), str(data_set)]) == 0
    said = capsys.readouterr()
    assert said.out == f"{data_set}: {STROKES} episodes of 6 bags\n"
    assert f"note: {REFUSED}: joint_velocity" in said.err
    assert f"note: {DAMAGED}: " in said.err
    assert main(["import", "--from", "lerobot", str(data_set), str(back)]) == 0
    assert capsys.readouterr().out == f"{back}: 6 bags, 0 episodes refused\n"
    assert contents(back) == contents(bags)


def test_columns_are_imported_by_a_mapping(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bags, data_set = mixed_folder(tmp_path / "bags"), tmp_path / "set-v0"
    assert main(["export", "--to", "minari", str(bags / "subject_01"), str(data_set)]) == 0
    mapping = data_set / "msrd_ros" / "contract.yaml"
    made = tmp_path / "made"
    assert main(["import", "--from", "minari", str(data_set), str(made), "--mapping", str(mapping)]) == 0
    assert capsys.readouterr().out.endswith(f"{made}: 2 bags, 0 episodes refused\n")
    assert main(["check", str(made)]) == 0


@pytest.mark.parametrize(
    ("arguments", "blame"),
    [
        (["export", "--to", "lerobot", "none", "set"], "export: error: none: does not exist"),
        (["import", "--from", "minari", "none", "bags"], "import: error: data set none: no bags are kept"),
        (
            ["import", "--from", "lerobot", "none", "bags", "--mapping", "m"],
            "import: error: mapping m: not readable",
        ),
    ],
)
def test_a_wrong_call_is_answered_with_its_reason(
    arguments: list[str],
    blame: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert capsys.readouterr().err.startswith(blame)
    assert not list(tmp_path.iterdir())
