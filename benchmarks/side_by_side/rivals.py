"""Environments of their own for what is compared with: their pins do not fit ours."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import venv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

SCRIPTS = Path(__file__).resolve().parent.parent / "rivals"
OLD_MUJOCO = (
    "imitation==1.0.1",
    "sb3-contrib==2.2.1",
    "gymnasium[mujoco]==0.29.1",
    "mujoco==2.3.3",
    "fancy-gym==0.3.0",
    "numpy<2",
    "torch",
)
"""`imitation` and Fancy Gym want the same old versions."""
MYOSUITE = ("myosuite==3.0.0",)


class NotInstalledError(Exception):
    """An environment could not be made; the last line that pip said."""


def environment(folder: Path, requirements: Sequence[str]) -> Path:
    """The interpreter of an environment with these requirements; made once, then used again.

    Raises
    ------
    NotInstalledError
        If pip cannot install them.
    """
    python = folder / "bin" / "python"
    made = folder / "requirements.txt"
    wanted = "\n".join(requirements)
    if made.is_file() and made.read_text(encoding="utf-8") == wanted:
        return python
    venv.create(folder, clear=True, with_pip=True)
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *requirements]
    done = subprocess.run(pip, capture_output=True, text=True, check=False)
    if done.returncode:
        raise NotInstalledError((done.stderr.strip().splitlines() or ["pip said nothing"])[-1])
    made.write_text(wanted, encoding="utf-8")
    return python


def ask(python: Path, script: str, *arguments: str, timeout_s: float = 900.0) -> Any:
    """What a script of `rivals/` prints as JSON in its last line, on one thread.

    Raises
    ------
    NotInstalledError
        If it ends with an error.
    """
    variables = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore"}
    command = [str(python), str(SCRIPTS / script), *arguments]
    beside = python.parent.parent  # MuJoCo writes its log to where it is started
    try:
        done = subprocess.run(
            command, cwd=beside, env=variables, capture_output=True, timeout=timeout_s, text=True, check=False
        )
    except subprocess.TimeoutExpired:
        raise NotInstalledError(f"{script} had not ended after {timeout_s:.0f} s") from None
    if done.returncode:
        sys.stderr.write(done.stderr)
        raise NotInstalledError((done.stderr.strip().splitlines() or [script])[-1])
    return json.loads(done.stdout.strip().splitlines()[-1])
