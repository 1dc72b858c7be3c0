"""Demonstrations from data sets of Minari and LeRobot: what goes in comes out, and misuse is named."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from gym_problems import Track
from lerobot_problem import FEATURES, FPS, LENGTHS, TASKS, episode
from msrd_ros.core.errors import UserError
from msrd_ros.learning.data_sets import demonstrations_from_lerobot, demonstrations_from_minari
from processes import CHECKOUT

WRITTEN_BY_LEROBOT = CHECKOUT / "test" / "data" / "lerobot"


def test_a_minari_data_set_is_read_as_it_was_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    minari = pytest.importorskip("minari")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))

    track, expected, episodes = Track(), [], []
    for label, push in (("left", -1.0), ("right", 1.0), ("left", -0.1), ("right", 0.1)):
        states, moves, over = [track.reset(seed=1)[0]], [], False
        while not over:
            moves.append(np.array([push], dtype=np.float32))
            seen, _, ended, cut, _ = track.step(moves[-1])
            states.append(seen)
            over = ended or cut
        expected.append((label, ended, np.array(states, dtype=np.float64)))
        last = np.arange(len(moves)) == len(moves) - 1
        episodes.append(
            minari.data_collector.EpisodeBuffer(
                observations=states,
                actions=moves,
                rewards=[0.0] * len(moves),
                terminations=list(last & ended),
                truncations=list(last & cut),
                infos={"label": [label] * len(states)},
            )
        )
    dataset = minari.create_dataset_from_buffers(
        "track/two-ways-v0",
        episodes,
        observation_space=track.observation_space,
        action_space=track.action_space,
    )
    found = demonstrations_from_minari(dataset, observation_names=("position", "speed"))
    assert found.layout.labels == ("left", "right")
    assert found.acting is not None
    for number, (label, ended, table) in enumerate(expected):
        place = found.layout.labels.index(label), number // 2
        steps = len(table) - 1
        assert found.acting[place] == steps
        assert found.step_counts()[place] == (found.horizon if ended else steps)
        assert np.allclose(found.observations[place][: steps + 1], table)
    with pytest.raises(UserError, match=r"no label 'style' in its infos \(there: label\)"):
        demonstrations_from_minari(dataset, label="style")
    with pytest.raises(UserError, match="Minari data set 'track/none-v0'"):
        demonstrations_from_minari("track/none-v0")


@pytest.mark.filterwarnings("ignore:strategy .* has one demonstration only")
def test_a_data_set_of_lerobots_is_read_as_it_was_recorded() -> None:
    found = demonstrations_from_lerobot(WRITTEN_BY_LEROBOT)
    assert found.layout.labels == TASKS
    assert found.layout.control_period_s == 1.0 / FPS
    assert found.layout.observation_names[:3] == tuple(f"observation.state.j{n}" for n in range(3))
    assert found.layout.action_names == ("j0", "j1", "j2")
    for number, length in enumerate(LENGTHS):
        rows = episode(number)
        seen = np.concatenate([rows[name] for name in FEATURES if name != "action"], axis=1)
        assert np.array_equal(found.observations[number, 0, :length], seen)
        assert np.array_equal(found.actions[number, 0, : length - 1], rows["action"][:-1])
        assert found.step_counts()[number, 0] == length - 1


@pytest.mark.filterwarnings("ignore:all demonstrations are of")
def test_features_and_labels_are_chosen() -> None:
    found = demonstrations_from_lerobot(
        WRITTEN_BY_LEROBOT,
        lambda one: "same" if one.number < 2 else None,
        ["observation.state"],
        terminated=True,
    )
    assert found.layout.labels == ("same",)
    assert found.layout.observation_names == ("j0", "j1", "j2")
    assert found.acting is not None
    assert found.acting.tolist() == [[length - 1 for length in LENGTHS]]


@pytest.mark.parametrize(
    ("arguments", "blame"),
    [
        ({"label": "style"}, "table of episodes has no column 'style'"),
        (
            {"observations": ["observation.images.top"]},
            "there is no feature 'observation.images.top'; there are",
        ),
        ({"action": "next.action"}, "there is no feature 'next.action'"),
    ],
)
def test_what_a_data_set_lacks_is_named(arguments: dict[str, object], blame: str) -> None:
    with pytest.raises(UserError, match=blame):
        demonstrations_from_lerobot(WRITTEN_BY_LEROBOT, **arguments)  # type: ignore[arg-type]


def broken(tmp_path: Path, file: str, content: bytes | None) -> Path:
    """The data set with one file changed, or taken away."""
    folder = Path(shutil.copytree(WRITTEN_BY_LEROBOT, tmp_path / "broken"))
    (folder / file).unlink()
    if content is not None:
        (folder / file).write_bytes(content)
    return folder


@pytest.mark.parametrize(
    ("file", "content", "blame"),
    [
        ("meta/info.json", None, "give the folder that holds meta/ and data/"),
        ("meta/tasks.parquet", b"PAR1", "tasks.parquet: is not readable"),
        ("data/chunk-000/file-000.parquet", b"version https://git-lfs.github.com", "run: git lfs pull"),
        ("data/chunk-000/file-000.parquet", None, "data/ holds no parquet file"),
    ],
)
def test_broken_data_sets_are_refused_by_file(
    tmp_path: Path, file: str, content: bytes | None, blame: str
) -> None:
    with pytest.raises(UserError, match=blame):
        demonstrations_from_lerobot(broken(tmp_path, file, content))


@pytest.mark.parametrize(
    ("key", "value", "blame"),
    [
        ("codebase_version", "v2.1", "is of version v2.1, .*convert_dataset_v21_to_v30"),
        ("fps", None, "info.json"),
    ],
)
def test_what_another_version_wrote_is_refused(tmp_path: Path, key: str, value: object, blame: str) -> None:
    info = json.loads((WRITTEN_BY_LEROBOT / "meta" / "info.json").read_text(encoding="utf-8"))
    folder = broken(tmp_path, "meta/info.json", json.dumps({**info, key: value}).encode())
    with pytest.raises(UserError, match=blame):
        demonstrations_from_lerobot(folder)


def test_rows_of_another_width_are_refused(tmp_path: Path) -> None:
    info = json.loads((WRITTEN_BY_LEROBOT / "meta" / "info.json").read_text(encoding="utf-8"))
    info["features"]["action"]["shape"] = [4]
    folder = broken(tmp_path, "meta/info.json", json.dumps(info).encode())
    with pytest.raises(UserError, match="action: rows are not 4 numbers each"):
        demonstrations_from_lerobot(folder)


def test_rows_that_are_missing_are_counted(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    folder = Path(shutil.copytree(WRITTEN_BY_LEROBOT, tmp_path / "torn"))
    file = folder / "data" / "chunk-000" / "file-000.parquet"
    parquet.write_table(parquet.read_table(file).slice(0, 40), file)
    with pytest.raises(UserError, match="episode 1 has 20 rows, and 25 are told"):
        demonstrations_from_lerobot(folder)
