"""Clocks that jump (libfaketime), disks that answer late (strace), and a recorder beside training."""

from __future__ import annotations

import shutil
import signal
import subprocess
import time
from pathlib import Path

from domains import reserved_domain
from faults.nodes import PLAYERS, RECOVERY_S, play
from faults.trials import Finding, NotTriedError, Setting, Trial
from msrd_ros.bags.reader import Bag
from msrd_ros.core.resources import shipped_bags
from stack import Stack
from stroke_source import StrokeSource
from synthetic_strokes import stroke_messages

JUMPS_S = (3600.0, -3600.0, 0.5, -0.5, 1e7)
_LIBRARIES = ("/usr/lib/*/faketime/libfaketimeMT.so.1", "/usr/lib*/faketime/libfaketimeMT.so.1")


def _fake_clock(file: Path) -> dict[str, str]:
    """Environment of a process whose wall clock follows a file, its steady clock untouched."""
    found = [path for pattern in _LIBRARIES for path in Path("/").glob(pattern.lstrip("/"))]
    if not found:
        raise NotTriedError("libfaketime is not installed (Debian: faketime)")
    _set_clock(file, 0.0)
    return {
        "LD_PRELOAD": str(found[0]),
        "FAKETIME_TIMESTAMP_FILE": str(file),
        "FAKETIME_NO_CACHE": "1",
        "DONT_FAKE_MONOTONIC": "1",
    }


def _set_clock(file: Path, offset_s: float) -> None:
    file.write_text(f"{offset_s:+.3f}\n", encoding="utf-8")


def _jumping(setting: Setting, mode: str) -> Finding:
    """Let the clock of one node after the other jump and come back."""
    rng, finding = setting.rng(f"clock {mode}"), Finding()
    files = {name: setting.folder / f"clock_{name}" for name in PLAYERS}
    environments = {name: _fake_clock(file) for name, file in files.items()}
    parameters = {name: {"mode": mode} for name in ("simulator", "executor")}
    with play(setting, finding, parameters, environments=environments) as scene:
        for _ in range(setting.count(20, least=2)):
            finding.tried += 1
            name = PLAYERS[int(rng.integers(len(PLAYERS)))]
            jump_s = JUMPS_S[int(rng.integers(len(JUMPS_S)))]
            scene.spin_for(float(rng.uniform(0.0, 2.0)))
            _set_clock(files[name], jump_s)
            scene.spin_for(float(rng.uniform(0.5, 4.0)))
            _set_clock(files[name], 0.0)
            scene.require_play(f"the clock of {name} jumped by {jump_s:g} s and back")
            scene.require_all(f"when the clock of {name} jumped")
    return finding


def jumps_in_lockstep(setting: Setting) -> Finding:
    """Wall clocks jump while simulated time goes on."""
    return _jumping(setting, "lockstep")


def jumps_in_real_time(setting: Setting) -> Finding:
    """The very clocks jump that stamps are made of."""
    return _jumping(setting, "real_time")


def slow_disk(setting: Setting) -> Finding:
    """Every file that the recorder opens, renames or syncs takes a second longer."""
    if shutil.which("strace") is None:
        raise NotTriedError("strace is not installed")
    finding = Finding()
    calls = "openat,rename,fsync,fdatasync,mkdir"
    with play(setting, finding) as scene:
        for _ in range(setting.count(3)):
            finding.tried += 1
            command = ["strace", "-f", "-qq", "-e", f"trace={calls}", "-o", "/dev/null"]
            command += ["-e", f"inject={calls}:delay_enter=1000000", "-p", str(scene.nodes["recorder"].pid)]
            tracer = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            time.sleep(0.5)
            if tracer.poll() is not None:
                assert tracer.stderr is not None
                raise NotTriedError(f"strace may not attach ({tracer.stderr.read().strip()[:80]})")
            scene.require_play("the disk answers late", balls=5)
            tracer.send_signal(signal.SIGINT)
            tracer.wait()
            kept, wanted = len(scene.guard.kept), scene.guard.outcomes + 5
            scene.require_play("the disk is quick again", balls=5)
            scene.spin_for(5.0)
            finding.require(
                len(scene.guard.kept) > kept, f"of {wanted} balls none was kept: {scene.last_words()}"
            )
    return finding


def recorder_beside_training(setting: Setting) -> Finding:
    """Joints at 1 kHz and ball at 200 Hz, recorded while a trainer has a processor for itself."""
    finding = Finding()
    bags = setting.folder / "bags"
    with reserved_domain() as domain, Stack(domain, setting.folder) as stack:
        source = StrokeSource(stack.node)
        stack.start("recorder", directory=bags, keep="all")
        trainer = stack.start(
            "trainer", bags=str(shipped_bags()), out=setting.folder / "run", iterations=100_000
        )
        source.wait_for_match()
        for number in range(1, setting.count(30, least=2) + 1):
            finding.tried += 1
            begin_ns = time.time_ns() + 1_000_000_000
            stroke = stroke_messages(start_ns=begin_ns, joint_hz=1000.0, ball_id=number)
            source.send_in_time(stroke)
            verdict = source.verdict(number)
            if not verdict["path"]:
                finding.break_promise(
                    f"stroke {number} is not kept: {verdict['reason']}, {verdict['detail']}"
                )
                continue
            kept = [m for m in Bag(verdict["path"]).raw() if m.topic == "/joint_states"]
            sequences = [message.sequence for message in kept]
            whole = sequences == list(range(sequences[0], sequences[0] + len(sequences)))
            finding.require(whole, f"stroke {number} lacks messages")
            finding.require(verdict["kept"] == "true", f"stroke {number}: {verdict['detail']}")
        finding.require(trainer.running, f"the trainer ended: {trainer.output[-300:]}")
        trainer.stop()
    return finding


_PLAYS_ON = f"limits kept; play goes on within {RECOVERY_S:.0f} s of the end; no node ends"
TRIALS = (
    Trial(
        "clock-lockstep", "a node's wall clock jumps and comes back, lockstep", _PLAYS_ON, jumps_in_lockstep
    ),
    Trial(
        "clock-real-time", "the same in real time, where stamps are made of it", _PLAYS_ON, jumps_in_real_time
    ),
    Trial("slow-disk", "the recorder's disk answers a second late", _PLAYS_ON, slow_disk),
    Trial(
        "record-and-train",
        "1 kHz joints and 200 Hz ball recorded beside training",
        "every message of every stroke is in its bag",
        recorder_beside_training,
    ),
)
