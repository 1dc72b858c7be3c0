"""Our simulators beside the table tennis environments that can be installed from PyPI."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import simulator
from side_by_side.rivals import MYOSUITE, OLD_MUJOCO, NotInstalledError, ask, environment
from side_by_side.table import Comparison

SECONDS = "10"
RIVALS = (
    ("Fancy Gym 0.3.0, TableTennis4D", "old-mujoco", OLD_MUJOCO, "fancy_gym", "fancy/TableTennis4D-v0"),
    ("MyoSuite 3.0.0, TableTennisP1", "myosuite", MYOSUITE, "myosuite", "myoChallengeTableTennisP1-v0"),
)
"""What was found on PyPI with an arm at a table: name, environment, requirements, module and task."""
NOTE = (
    "simulated seconds a second of the processor, one process, one thread, resets included. Ours: "
    "strokes of random policies, 1.96 s an episode, the way back to the ready pose played but not "
    "counted. Theirs: uniform random actions over gymnasium's step, simulated time as MuJoCo tells "
    "it. Fancy Gym has a Barrett WAM of 7 joints at 2 ms steps; MyoSuite an arm and trunk of 275 "
    "actuators, most of them muscles"
)


def compare(folder: Path, episodes: int) -> Iterator[Comparison]:
    """Lines of the table.

    Parameters
    ----------
    folder
        Where their environments are made.
    episodes
        How many of ours are played in Bullet.
    """
    ours = [
        ("Bullet world", next(simulator.in_bullet([1], episodes, time.process_time)).real_time),
        ("batched simulator", next(simulator.batched([1], time.process_time)).real_time),
    ]
    for name, where, requirements, module, task in RIVALS:
        try:
            theirs = ask(environment(folder / where, requirements), "table_tennis.py", module, task, SECONDS)
        except NotInstalledError as error:
            for what, rate in ours:
                yield Comparison(what, "x real time", rate, name, note=f"{name} could not be asked: {error}")
            continue
        for what, rate in ours:
            yield Comparison(what, "x real time", rate, name, theirs["real_time"], note=NOTE)
