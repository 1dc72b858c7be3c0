"""The trainer as a process: from a folder of bags, resumed exactly, its services, the policies it sends."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import UInt8MultiArray

from libraries import copy_of
from msrd_ros.cluster.on_ray import ADDRESS_VARIABLE
from msrd_ros.contract.labels import WITHOUT_LABEL
from msrd_ros.nodes.common import EVENT, LATCHED
from msrd_ros.recordings.curation import Curation
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from processes import RunningProcess
from stack import Stack, one_line

pytestmark = pytest.mark.processes

LABELS = ALL_LABELS[:2]
ITERATIONS = 8
TINY: dict[str, Any] = {
    "labels": f"[{', '.join(map(str, LABELS))}]",
    "subjects": "[subject_01]",
    "episodes": 8,
    "evaluate_every": 1,
    "evaluation_balls": 4,
    "workers": 1,
    "torch_threads": 1,
}


def finish(trainer: RunningProcess, out: Path) -> StrokePolicies:
    """Wait for the end of training; what it wrote."""
    assert trainer.wait(200.0) == 0, trainer.output
    trainer.wait_for_line(f"policies written to {out / 'policies.safetensors'}")
    return StrokePolicies.load(out / "policies.safetensors")


def test_training_resumes_exactly_and_its_policies_are_taken_by_an_executor(
    stack: Stack, tmp_path: Path
) -> None:
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    progress: list[DiagnosticArray] = []
    sent: list[UInt8MultiArray] = []
    stack.node.create_subscription(DiagnosticArray, "training/progress", progress.append, EVENT)
    stack.node.create_subscription(UInt8MultiArray, "policy", sent.append, LATCHED)
    whole_run = stack.start("trainer", **TINY, out=whole, iterations=ITERATIONS)
    stack.wait_until(lambda: sent and progress, "policies and progress", 200.0, whole_run)
    expected = finish(whole_run, whole)
    assert expected.labels == LABELS
    assert [status.name for status in progress[0].status] == ["trainer"]
    result = json.loads((whole / "training.json").read_text())
    assert result["iterations"] == ITERATIONS
    assert result["demonstrations"] == {str(label): 3 for label in LABELS}
    assert [row["iteration"] for row in result["curve"]] == list(range(ITERATIONS + 1))
    assert list((whole / "tensorboard").iterdir())

    interrupted = stack.start("trainer", **TINY, out=parts, iterations=ITERATIONS)
    assert stack.trigger("trainer/checkpoint").success
    stack.wait_until((parts / "checkpoint.safetensors").exists, "checkpoint", 200.0, interrupted)
    assert stack.trigger("trainer/stop").success
    finish(interrupted, parts)
    done = json.loads((parts / "training.json").read_text())["iterations"]
    assert 0 < done < ITERATIONS

    executor = stack.start("executor")
    executor.wait_for_line("ready: lockstep, no policies yet")
    stack.start_simulator(show=False)
    resumed = stack.start("trainer", **TINY, out=parts, iterations=ITERATIONS, resume=True)
    resumed.wait_for_line(f"goes on from iteration {done} of {parts}", 200.0)
    assert finish(resumed, parts).digest == expected.digest
    # Published last, while training still ran: the policies that were written.
    stack.wait_until(
        lambda: stack.diagnosed("executor")["policies"] == expected.digest, "policies", 60.0, executor
    )


@pytest.mark.slow
def test_rollouts_on_ray_teach_the_same_as_those_of_processes(
    stack: Stack, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(ADDRESS_VARIABLE, raising=False)
    settings = {**TINY, "iterations": 1, "evaluate_every": 0}
    bullet, ray = tmp_path / "bullet", tmp_path / "ray"
    in_processes = finish(stack.start("trainer", **settings, out=bullet, rollouts="bullet"), bullet)
    on_ray = finish(stack.start("trainer", **{**settings, "workers": 2}, out=ray, rollouts="ray"), ray)
    assert on_ray.digest == in_processes.digest


def test_services_checkpoint_and_stop(stack: Stack, tmp_path: Path) -> None:
    quick = {**TINY, "evaluate_every": 0}
    trainer = stack.start("trainer", **quick, out=tmp_path, iterations=100_000, checkpoint_every=0)
    assert stack.trigger("trainer/checkpoint").success
    again = stack.trigger("trainer/start")
    assert not again.success
    assert again.message == "training is under way"
    path = tmp_path / "checkpoint.safetensors"
    stack.wait_until(path.exists, "checkpoint", 120.0, trainer)
    assert trainer.running
    assert stack.trigger("trainer/stop").success
    policies = finish(trainer, tmp_path)
    assert policies.labels == LABELS
    assert 0 < json.loads((tmp_path / "training.json").read_text())["iterations"] < 100_000


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_to_end_loses_nothing_that_was_learned(
    stack: Stack, tmp_path: Path, end: signal.Signals
) -> None:
    progress: list[DiagnosticArray] = []
    stack.node.create_subscription(DiagnosticArray, "training/progress", progress.append, EVENT)
    trainer = stack.start("trainer", **TINY, out=tmp_path, iterations=100_000, checkpoint_every=0)
    stack.wait_until(lambda: len(progress) > 1, "progress", 200.0, trainer)
    assert trainer.stop(end) == 0, trainer.output
    assert "Traceback" not in trainer.output
    heard = max(int(value_of(message, "iteration")) for message in progress)
    done = json.loads((tmp_path / "training.json").read_text())["iterations"]
    assert done >= heard
    resumed = stack.start("trainer", **TINY, out=tmp_path, iterations=100_000, resume=True)
    resumed.wait_for_line(f"goes on from iteration {done} of", 200.0)
    assert stack.trigger("trainer/stop").success
    finish(resumed, tmp_path)


def value_of(message: DiagnosticArray, key: str) -> str:
    """One figure of the progress."""
    return str(next(pair.value for pair in message.status[0].values if pair.key == key))


def test_strokes_without_a_label_are_refused_by_name_with_the_ways_out(stack: Stack, tmp_path: Path) -> None:
    folder = copy_of("subject_01", *(f"{label}_001" for label in LABELS), target=tmp_path / "bags")
    for label in LABELS:
        Curation(folder).relabel(folder / "subject_01" / f"{label}_001", "")
    trainer = stack.start("trainer", bags=folder, out=tmp_path / "out")
    assert (
        f"no demonstration is left; bag {folder}/subject_01/unlabelled_001: no_label, {WITHOUT_LABEL}"
        in one_line(trainer, "trainer")
    )

    # Heard over topics they are left out one by one.
    trainer = stack.start("trainer", source="played", out=tmp_path / "out")
    trainer.wait_for_line("ready: waiting")
    player = stack.start("player", bags=f"[{folder}]", rate=5.0)
    assert player.wait(90.0) == 0, player.output
    trainer.wait_for_line(r"ball \d+ is left out: no_label, no strategy label; give it one")
    assert "no demonstration has arrived" in stack.trigger("trainer/start").message
    assert trainer.stop() == 0


def test_strategies_are_found_in_strokes_without_labels(stack: Stack, tmp_path: Path) -> None:
    labels = [LABELS[0], ALL_LABELS[4]]
    bags = [f"{label}_{number:03d}" for label in labels for number in (1, 2, 3)]
    subjects = [f"subject_0{number}" for number in (1, 2, 3)]
    folder = tmp_path / "bags"
    for subject in subjects:
        copy_of(subject, *bags, target=folder)
        for bag in bags:
            Curation(folder).relabel(folder / subject / bag, "")
    alone = stack.start("trainer", labels=f"[discover, {LABELS[0]}]", bags=folder, out=tmp_path / "none")
    assert "parameter labels of trainer: discover stands alone" in one_line(alone, "trainer")

    out = tmp_path / "out"
    settings = {**TINY, "labels": "discover", "subjects": "[]"}
    trainer = stack.start("trainer", **settings, bags=folder, out=out, iterations=1)
    policies = finish(trainer, out)
    found = json.loads((out / "strategies.json").read_text())
    # A subject's bags were relabelled in turn.
    groups = [{Path(stroke["bag"]).name for stroke in own} for own in found["strategies"].values()]
    assert sorted(groups, key=min) == [
        {"unlabelled_001", "unlabelled_002", "unlabelled_003"},
        {"unlabelled_004", "unlabelled_005", "unlabelled_006"},
    ]
    assert set(map(str, policies.labels)) == set(found["strategies"]) == {"strategy-1", "strategy-2"}
    assert found["doubted"] == []
    result = json.loads((out / "training.json").read_text())
    assert result["recheck"]["of"] == 18
    trainer.wait_for_line("of 18 strokes .* are likeliest under the policy of the strategy")
    assert sorted(does["side"] for does in found["does"].values()) == ["backhand", "forehand"]
    for name, does in found["does"].items():
        trainer.wait_for_line(rf"{name} \(9 strokes\): {does['side']}, {does['spin']}")


def test_without_demonstrations_there_is_nothing_to_start(stack: Stack, tmp_path: Path) -> None:
    trainer = stack.start("trainer", source="played", out=tmp_path)
    refused = stack.trigger("trainer/start")
    assert not refused.success
    assert refused.message == "no demonstration has arrived yet; play some bags"
    assert not stack.trigger("trainer/checkpoint").success
    assert trainer.stop() == 0
