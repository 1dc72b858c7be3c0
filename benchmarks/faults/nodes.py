"""Faults of processes: killed, stopped, starved, without room on the disk."""

from __future__ import annotations

import contextlib
import resource
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from domains import reserved_domain
from faults.files import mutate_yaml
from faults.guard import Guard, check_kept, wait_until
from faults.trials import Finding, NotTriedError, Setting, Trial
from made_up_policies import made_up_policies
from msrd_ros.robots.loading import default_robot
from processes import RunningProcess
from stack import Stack

PLAYERS = ("simulator", "executor", "evaluator", "recorder")
CONFIG = Path(__file__).parents[2] / "config"
RECOVERY_S = 60.0
"""How long after the end of a fault balls may stay away."""
COMPILING_S = 300.0
"""How long the first start after an installation may take."""
TIMEOUT_S = 20.0
"""How long an evaluator waits; one whose simulator has died ends then, and is started again."""


@dataclass
class Play:
    """A stack that plays and records without end, and what is noticed of it.

    Attributes
    ----------
    finding
        Hears of broken promises.
    """

    stack: Stack
    folder: Path
    policies: Path
    finding: Finding
    parameters: dict[str, dict[str, Any]]
    remaps: Mapping[str, Sequence[str]]
    environments: Mapping[str, Mapping[str, str]]
    relays: list[Any] = field(default_factory=list)
    nodes: dict[str, RunningProcess] = field(default_factory=dict)

    def __post_init__(self) -> None:
        common: dict[str, dict[str, Any]] = {
            "simulator": {"seed": 1, "show": False},
            "executor": {"checkpoint": self.policies},
            "evaluator": {"labels": "[forehand-push]", "balls": 100_000, "timeout_s": TIMEOUT_S},
            "recorder": {"directory": self.folder / "bags", "keep": "all"},
        }
        self.parameters = {name: {**facts, **self.parameters.get(name, {})} for name, facts in common.items()}
        self.guard = Guard(self.stack.node, default_robot(), self.finding)

    @property
    def bags(self) -> Path:
        """Where the recorder writes."""
        return Path(self.parameters["recorder"]["directory"])

    def start(self, name: str) -> None:
        """Start a node, or start it again."""
        if name == "executor":
            self.guard.forget()
        words = [word for remap in self.remaps.get(name, ()) for word in ("-r", remap)]
        arguments = ["--ros-args", *words] if words else []
        environment = self.environments.get(name, {})
        for variable, value in environment.items():
            self.stack.launcher.set(variable, value)
        self.nodes[name] = self.stack.launcher.start(name, *arguments, parameters=self.parameters[name])
        for variable in environment:
            self.stack.launcher.unset(variable)

    def spin(self) -> None:
        """Take what has come."""
        self.stack.executor.spin_once(timeout_sec=0.02)

    def spin_for(self, seconds: float) -> None:
        """Take what comes for a while."""
        wait_until(self.spin, lambda: False, seconds)

    def require_play(self, after: str, balls: int = 2, within_s: float = RECOVERY_S) -> None:
        """Some balls are decided from now on."""
        wanted = self.guard.outcomes + balls

        def decided() -> bool:
            self.revive("evaluator")  # it reports nothing of two worlds, and says so
            return self.guard.outcomes >= wanted

        held = wait_until(self.spin, decided, within_s)
        self.finding.require(held, f"no ball in {within_s:.0f} s after {after}: {self.last_words()}")

    def last_words(self) -> str:
        """The last line that each node has printed."""
        words = []
        for name, process in self.nodes.items():
            lines = process.output.strip().splitlines()
            words.append(f"{name}: {lines[-1][-160:] if lines else 'nothing'}")
        return " | ".join(words)

    def revive(self, *names: str) -> None:
        """Start those again that have ended by themselves, each with a cause."""
        for name in names:
            if not self.nodes[name].running:
                self.require_a_cause(name)
                self.start(name)

    def require_all(self, when: str) -> None:
        """No node has ended; one that has is started again."""
        for name in PLAYERS:
            self.finding.require(self.nodes[name].running, f"{name} ended {when}")
        self.revive(*PLAYERS)

    def require_a_cause(self, name: str) -> None:
        """A node that has ended by itself has said why, and not with a traceback."""
        output = self.nodes[name].output
        self.finding.require("Traceback" not in output, f"{name} ended with a traceback: {output[-300:]}")
        self.finding.require("error:" in output, f"{name} ended without a cause: {output[-300:]}")


@contextlib.contextmanager
def play(
    setting: Setting,
    finding: Finding,
    parameters: Mapping[str, dict[str, Any]] = MappingProxyType({}),
    remaps: Mapping[str, Sequence[str]] = MappingProxyType({}),
    connect: Callable[[Play], list[Any]] = lambda _: [],
    environments: Mapping[str, Mapping[str, str]] = MappingProxyType({}),
) -> Iterator[Play]:
    """A whole stack in lockstep time, playing; checked once more at its end.

    Parameters
    ----------
    setting, finding
        Of the trial.
    parameters, remaps, environments
        Of nodes by name, besides those that every trial has.
    connect
        Puts something between the nodes before they are started.
    """
    policies = setting.folder / "policies.safetensors"
    policies.write_bytes(made_up_policies().to_bytes())
    with reserved_domain() as domain, Stack(domain, setting.folder) as stack:
        scene = Play(stack, setting.folder, policies, finding, dict(parameters), remaps, environments)
        scene.relays = connect(scene)
        for name in ("simulator", "executor", "recorder", "evaluator"):
            scene.start(name)
        scene.require_play("the start", within_s=COMPILING_S)
        yield scene
        finding.figures["commands"] = scene.guard.commands
        for name in ("evaluator", "executor", "recorder", "simulator"):
            process = scene.nodes[name]
            if not process.running:
                scene.require_a_cause(name)
                continue
            code = process.stop()
            finding.require(code == 0, f"{name} ended with {code} when told to stop: {process.output[-300:]}")
            finding.require("Traceback" not in process.output, f"{name}: traceback: {process.output[-300:]}")
        check_kept(scene.guard, scene.bags, finding)


def killed(setting: Setting) -> Finding:
    """SIGKILL one node at a random moment, start it again."""
    rng, finding = setting.rng("killed"), Finding()
    with play(setting, finding) as scene:
        for _ in range(setting.count(60, least=4)):
            finding.tried += 1
            name = PLAYERS[finding.tried % len(PLAYERS)]
            scene.spin_for(float(rng.uniform(0.0, 3.0)))
            scene.nodes[name].kill()
            scene.spin_for(float(rng.uniform(0.0, 2.0)))
            scene.start(name)
            scene.require_play(f"{name} was killed and started again")
            scene.revive(*PLAYERS)
    return finding


def stopped(setting: Setting) -> Finding:
    """SIGSTOP one node for a while at a random moment."""
    rng, finding = setting.rng("stopped"), Finding()
    with play(setting, finding) as scene:
        for _ in range(setting.count(60, least=4)):
            finding.tried += 1
            name = PLAYERS[finding.tried % len(PLAYERS)]
            scene.spin_for(float(rng.uniform(0.0, 2.0)))
            scene.nodes[name].send_signal(signal.SIGSTOP)
            scene.spin_for(float(rng.uniform(0.1, 4.0)))
            scene.nodes[name].send_signal(signal.SIGCONT)
            scene.require_play(f"{name} stood still for a while")
            scene.require_all(f"while {name} stood still")
    return finding


def without_cpu(setting: Setting) -> Finding:
    """Stop all nodes together for a minute, as a machine that swaps does."""
    finding = Finding()
    seconds = 60.0 if setting.share >= 1.0 else 5.0
    with play(setting, finding) as scene:
        for _ in range(setting.count(2)):
            finding.tried += 1
            for process in scene.nodes.values():
                process.send_signal(signal.SIGSTOP)
            time.sleep(seconds)
            for process in scene.nodes.values():
                process.send_signal(signal.SIGCONT)
            scene.require_play(f"{seconds:.0f} s without a processor")
    finding.figures["seconds each"] = int(seconds)
    return finding


def file_size_limit(setting: Setting) -> Finding:
    """Let the recorder's process write no file beyond some size, then lift it (RLIMIT_FSIZE)."""
    rng, finding = setting.rng("file size"), Finding()
    with play(setting, finding) as scene:
        for _ in range(setting.count(20, least=2)):
            finding.tried += 1
            pid = scene.nodes["recorder"].pid
            size = int(rng.integers(1, 100_000))
            resource.prlimit(pid, resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
            scene.require_play(f"files of the recorder end at {size} bytes", balls=3)
            resource.prlimit(pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)
            kept = len(scene.guard.kept)
            recovered = wait_until(scene.spin, lambda kept=kept: len(scene.guard.kept) > kept, RECOVERY_S)  # type: ignore[misc]
            finding.require(recovered, f"nothing is kept after the limit is gone: {scene.last_words()}")
    return finding


def full_disk(setting: Setting) -> Finding:
    """Fill the small disk that the recorder writes to, then make room again."""
    mount = setting.folder / "small"
    with _small_disk(mount, 8):
        finding = Finding()
        with play(setting, finding, _recording_to(mount)) as scene:
            for _ in range(setting.count(10)):
                finding.tried += 1
                filler = mount / "filler"
                with contextlib.suppress(OSError), filler.open("wb") as file:
                    while True:
                        file.write(bytes(4096))
                        file.flush()
                scene.require_play("the disk is full", balls=3)
                filler.unlink()
                for bag in scene.guard.kept:
                    shutil.rmtree(bag, ignore_errors=True)
                scene.guard.kept.clear()
                recovered = wait_until(scene.spin, lambda: bool(scene.guard.kept), RECOVERY_S)
                finding.require(recovered, f"nothing is kept after there is room again: {scene.last_words()}")
    return finding


def read_only_disk(setting: Setting) -> Finding:
    """Turn the disk that the recorder writes to read-only, then back."""
    mount = setting.folder / "small"
    with _small_disk(mount, 64):
        finding = Finding()
        with play(setting, finding, _recording_to(mount)) as scene:
            for _ in range(setting.count(10)):
                finding.tried += 1
                _mount("-o", "remount,ro", str(mount))
                scene.require_play("the disk is read-only", balls=3)
                _mount("-o", "remount,rw", str(mount))
                kept = len(scene.guard.kept)
                recovered = wait_until(scene.spin, lambda kept=kept: len(scene.guard.kept) > kept, RECOVERY_S)  # type: ignore[misc]
                finding.require(recovered, f"nothing is kept once it can be written: {scene.last_words()}")
    return finding


def _recording_to(mount: Path) -> dict[str, dict[str, Any]]:
    return {"recorder": {"directory": mount / "bags", "minimum_free_mb": 0.0}}


@contextlib.contextmanager
def _small_disk(mount: Path, megabytes: int) -> Iterator[None]:
    mount.mkdir(parents=True, exist_ok=True)
    _mount("-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs", str(mount))
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(mount)], check=False)


def _mount(*arguments: str) -> None:
    try:
        done = subprocess.run(["mount", *arguments], capture_output=True, text=True, check=False)
    except FileNotFoundError:
        raise NotTriedError("there is no mount") from None
    if done.returncode:
        raise NotTriedError(f"no small disk can be mounted ({done.stderr.strip()})")


def damaged_parameter_files(setting: Setting) -> Finding:
    """Start nodes with parameter files that were mutated: they run, or end with one line that says why."""
    rng, finding = setting.rng("parameter files"), Finding()
    names = ("executor", "player", "recorder", "simulator", "trainer")
    with reserved_domain() as domain, Stack(domain, setting.folder) as stack:
        for number in range(setting.count(60, least=2)):
            finding.tried += 1
            name = names[number % len(names)]
            path = setting.folder / f"{name}_{number}.yaml"
            path.write_bytes(mutate_yaml((CONFIG / f"{name}.yaml").read_bytes(), rng))
            process = stack.launcher.start(name, "--ros-args", "--params-file", str(path))
            wait_until(lambda: time.sleep(0.05), lambda p=process: not p.running or "ready" in p.output, 30.0)  # type: ignore[misc]
            if process.running:
                process.kill()
                continue
            lines = [line for line in process.output.splitlines() if f"{name}: error: " in line]
            finding.require(
                len(lines) == 1, f"{path.name}: {len(lines)} error lines: {process.output[-300:]}"
            )
            finding.require(
                "Traceback" not in process.output, f"{path.name}: traceback: {process.output[-300:]}"
            )
    return finding


_PLAYS_ON = "limits kept; play goes on; what was kept is there; who ends says why"
TRIALS = (
    Trial("killed", "SIGKILL of a node in play, started again", _PLAYS_ON, killed),
    Trial("stopped", "SIGSTOP of a node in play, up to 4 s", _PLAYS_ON, stopped),
    Trial("without-cpu", "no processor for all nodes together", _PLAYS_ON, without_cpu),
    Trial("file-size", "files of the recorder cannot grow", _PLAYS_ON, file_size_limit),
    Trial("disk-full", "the recorder's disk is full", _PLAYS_ON, full_disk),
    Trial(
        "parameter-files",
        "nodes started with mutated parameter files",
        "runs, or ends with one line that says why",
        damaged_parameter_files,
    ),
    Trial("disk-read-only", "the recorder's disk turns read-only", _PLAYS_ON, read_only_disk),
)
