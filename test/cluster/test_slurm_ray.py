"""The script that starts Ray inside a job of SLURM, on a machine that only pretends to have SLURM."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from processes import CHECKOUT

SCRIPT = CHECKOUT / "scripts" / "slurm_ray.sh"
LOOPBACK = "127.0.0.1"

STAND_INS = {
    "scontrol": "printf 'first\\nsecond\\nthird\\n'",
    "hostname": f"echo {LOOPBACK}",
    # What is run stands after the last option's value.
    "srun": 'while [[ "$1" == --* ]]; do [[ "$1" == --overlap ]] || shift; shift; done; exec "$@"',
    "python": f"""
case "$1 $2" in
    "-c "*) exec {sys.executable} "$@" ;;
    *ray.scripts.scripts*)
        echo "$3 $4 $5 $6 $7 $8 ${{#RAY_AUTH_TOKEN}} digits" >> "$LOG"
        [[ "$4" == --head ]] && exec {sys.executable} "$LISTENER" "$8"
        exec sleep 60 ;;
    *) until [ $(wc -l < "$LOG") -ge 3 ]; do sleep .1; done
        echo "$* at $RAY_ADDRESS" >> "$LOG"; exit "$STATUS" ;;
esac""",
}
LISTENER = f"""
import socket, sys, time
listening = socket.create_server(("{LOOPBACK}", int(sys.argv[1])))
time.sleep(60)
"""


@pytest.fixture
def job(tmp_path: Path) -> dict[str, str]:
    """Environment of a job."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for name, body in STAND_INS.items():
        (folder / name).write_text(f"#!/usr/bin/env bash\n{body}\n")
        (folder / name).chmod(0o755)
    (tmp_path / "listener.py").write_text(LISTENER)
    with socket.create_server((LOOPBACK, 0)) as free:
        port = free.getsockname()[1]
    return {
        **os.environ,
        "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}",
        "PYTHON": "python",
        "PORT": str(port),
        "LOG": str(tmp_path / "log"),
        "LISTENER": str(tmp_path / "listener.py"),
        "STATUS": "0",
        "SLURM_JOB_ID": "7",
        "SLURM_JOB_NODELIST": "first,second,third",
        "SLURM_CPUS_PER_TASK": "4",
    }


def run(job: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["bash", SCRIPT, *arguments], env=job, capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize("status", [0, 1])
def test_ray_is_started_on_all_machines_and_ended_with_the_command(job: dict[str, str], status: int) -> None:
    begun_s = time.monotonic()
    done = run({**job, "STATUS": str(status)}, "all", "--seeds", "5")
    assert done.returncode == status, done.stderr
    assert time.monotonic() - begun_s < 50.0
    place = f"{LOOPBACK}:{job['PORT']}"
    head, *rest = Path(job["LOG"]).read_text().splitlines()
    assert head.startswith(f"start --head --node-ip-address {LOOPBACK} --port {job['PORT']}")
    assert head.endswith("64 digits")
    assert sorted(line.startswith(f"start --address {place} --num-cpus 4") for line in rest) == [
        False,
        True,
        True,
    ]
    assert f"-m msrd_ros reproduce all --seeds 5 --on ray at {place}" in rest


@pytest.mark.parametrize(
    ("missing", "said"),
    [("SLURM_JOB_ID", "this runs inside a job"), ("SLURM_CPUS_PER_TASK", "--cpus-per-task")],
)
def test_outside_of_a_job_it_says_how_to_run_it(job: dict[str, str], missing: str, said: str) -> None:
    del job[missing]
    done = run(job, "all")
    assert done.returncode != 0
    assert said in done.stderr


def test_without_a_study_it_asks_for_one(job: dict[str, str]) -> None:
    done = run(job)
    assert done.returncode == 2
    assert "which study?" in done.stderr
