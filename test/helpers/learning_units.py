"""Units that learn, and may wait to be ended, for tests of workers that are lost; on the path of workers."""

from __future__ import annotations

import os
import time
from pathlib import Path

from msrd_ros.studies.inverted_pendulum.demonstrators import Kind, cached_demonstrators
from msrd_ros.studies.inverted_pendulum.study import PENDULUM
from msrd_ros.studies.shared.method import Budget, Exercise
from msrd_ros.studies.shared.methods import METHODS

PATIENCE_S = 60.0


def learn(shared: tuple[str, tuple[int, ...]], number: int) -> dict[str, bytes]:
    """Train on the pendulum; weights by name.

    The numbers of `shared` leave a mark with process and machine the first time, and wait to be ended.
    """
    folder, waiting = shared
    mark = Path(folder) / str(number)
    if number in waiting and not mark.exists():
        import ray

        node = ray.get_runtime_context().get_node_id()
        draft = mark.with_suffix(".part")
        draft.write_text(f"{os.getpid()} {node}")
        draft.rename(mark)
        time.sleep(PATIENCE_S)
        raise TimeoutError("nobody ended this process")
    data = cached_demonstrators(Kind.DIAYN).demonstrate(2, seed=number)
    budget = Budget(iterations=2, episodes=1, horizon=200, cloning_steps=20, classifier_steps=20)
    tensors = METHODS["msrd"].train(Exercise(PENDULUM, data, budget, number)).tensors()
    return {name: value.numpy().tobytes() for name, value in tensors.items() if name != "cost"}
