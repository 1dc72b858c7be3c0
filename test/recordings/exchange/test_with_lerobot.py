"""LeRobot itself reads what is exported to it, agrees on its statistics, edits it, and trains on it.

Needs LeRobot: ``make test-lerobot`` runs this in an environment of its own.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msrd_ros.core.resources import shipped_bags
from msrd_ros.learning.data_sets import demonstrations_from_lerobot
from msrd_ros.recordings.demonstrations import load_strokes
from msrd_ros.recordings.exchange.exporting import export_bags
from msrd_ros.recordings.exchange.importing import import_columns
from msrd_ros.recordings.exchange.lerobot_set import stroke_rows
from msrd_ros.robots.loading import default_robot

pytest.importorskip("lerobot", reason="make test-lerobot runs it")

SUBJECT = "subject_01"
POLICIES = {
    "act": ["--policy.dim_model=64", "--policy.chunk_size=20", "--policy.n_action_steps=20"],
    "diffusion": ["--policy.down_dims=[64,128]", "--policy.horizon=16", "--policy.num_train_timesteps=20"],
}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The strokes of a subject, without pictures."""
    target = tmp_path_factory.mktemp("lerobot") / "strokes"
    export_bags(shipped_bags() / SUBJECT, target, "lerobot", default_robot(), {})
    return target


def load(root: Path, **options: Any) -> Any:
    """What LeRobot makes of a folder."""
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    return LeRobotDataset("msrd/strokes", root, **options)


def test_every_row_is_loaded(root: Path) -> None:
    dataset = load(root, delta_timestamps={"action": [0.0, 0.02]})
    strokes = load_strokes(shipped_bags() / SUBJECT)
    assert dataset.num_episodes == len(strokes)
    for number, stroke in enumerate(strokes):
        begin = int(dataset.meta.episodes[number]["dataset_from_index"])
        rows = stroke_rows(stroke)
        for step in (0, 40, len(stroke.actions) - 1):
            found = dataset[begin + step]
            assert found["task"] == stroke.label
            for name in ("observation.state", "observation.environment_state", "joint_velocity"):
                assert np.array_equal(found[name].numpy(), rows[name][step])
            following = min(step + 1, len(stroke.actions) - 1)
            assert np.array_equal(found["action"].numpy(), rows["action"][[step, following]])


def test_its_own_statistics_agree(root: Path) -> None:
    from lerobot.datasets.compute_stats import aggregate_stats, compute_episode_stats

    dataset = load(root)
    parts = []
    for number in range(dataset.num_episodes):
        told = dataset.meta.episodes[number]
        rows = dataset.hf_dataset.with_format("numpy")[told["dataset_from_index"] : told["dataset_to_index"]]
        parts.append(compute_episode_stats(rows, dataset.features))
    theirs = aggregate_stats(parts)
    assert theirs.keys() == dataset.meta.stats.keys()
    for feature, one in theirs.items():
        span = np.maximum(one["max"] - one["min"], 1e-6)
        for key, value in one.items():
            # Bins of histograms; single precision, and deviations as differences of squares in it.
            exact = 1 / 5000 if key[0] == "q" else 1e-3 if key == "std" else 1e-6
            assert (np.abs(dataset.meta.stats[feature][key] - value) <= exact * span).all(), (feature, key)


def test_what_it_splits_off_is_imported_by_the_contract(root: Path, tmp_path: Path) -> None:
    from lerobot.datasets.dataset_tools import delete_episodes

    delete_episodes(load(root), [0, 2], tmp_path / "less", "msrd/less")
    mapping = tmp_path / "mapping.yaml"
    text = (root / "msrd_ros" / "contract.yaml").read_text(encoding="utf-8")
    mapping.write_text(f"{text}subject: {SUBJECT}\n", encoding="utf-8")
    done = import_columns(tmp_path / "less", tmp_path / "bags", "lerobot", mapping)
    assert (done.bags, done.refused) == (16, ())
    assert len(demonstrations_from_lerobot(tmp_path / "less").layout.labels) == 6


def test_it_merges_data_sets_and_strokes_keep_their_labels(root: Path, tmp_path: Path) -> None:
    from lerobot.datasets.dataset_tools import merge_datasets

    other = tmp_path / "other"
    export_bags(shipped_bags() / "subject_02", other, "lerobot", default_robot(), {})
    merged = merge_datasets([load(root), load(other)], "msrd/both", tmp_path / "both")
    assert merged.num_episodes == 36
    assert set(merged.meta.episodes["subject"]) == {SUBJECT, "subject_02"}
    found = demonstrations_from_lerobot(tmp_path / "both", label="label")
    assert len(found.layout.labels) == 6
    assert found.observations.shape[1] == 6


def test_pictures_are_decoded(tmp_path: Path) -> None:
    bag = shipped_bags() / SUBJECT / "forehand-push_001"
    export_bags(bag, tmp_path / "film", "lerobot", default_robot(), {}, video=True)
    # torchcodec, the usual decoder, wants a system's FFmpeg.
    dataset = load(tmp_path / "film", video_backend="pyav")
    (name,) = dataset.meta.video_keys
    first, later = (dataset[step][name].numpy() for step in (0, 50))
    assert first.shape == later.shape == (3, 240, 320)
    assert np.abs(first - later).max() > 0.3
    assert np.allclose(dataset.meta.stats[name]["mean"][:, 0, 0], later.mean((1, 2)), atol=0.05)


@pytest.mark.parametrize("policy", POLICIES)
def test_its_policies_train(policy: str, root: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "lerobot.scripts.lerobot_train", f"--policy.type={policy}"]
    command += [
        "--dataset.repo_id=msrd/strokes",
        f"--dataset.root={root}",
        f"--output_dir={tmp_path / 'run'}",
    ]
    command += ["--steps=20", "--batch_size=8", "--log_freq=10", "--num_workers=0", "--save_checkpoint=false"]
    command += ["--policy.device=cpu", "--policy.push_to_hub=false", *POLICIES[policy]]
    done = subprocess.run(command, capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, done.stderr[-3000:]
    assert "step:20" in done.stderr
    assert "End of training" in done.stderr
    assert "loss:nan" not in done.stderr
