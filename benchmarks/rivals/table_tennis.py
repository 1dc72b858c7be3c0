"""How fast a table tennis environment of gymnasium steps; in an environment of its own.

Arguments: the module that registers it, its name, processor seconds to measure. Uniform random actions, new
episodes as they end. Prints JSON: simulated seconds and steps a second of those, the step's
length in s and the episodes.
"""

from __future__ import annotations

import importlib
import json
import sys
import time
from typing import Any

import gymnasium


def simulated_s(world: Any) -> float:
    """The simulation's own time, in seconds."""
    for holder in (world, getattr(world, "sim", None)):
        for name in ("data", "mj_data"):
            data: Any = getattr(holder, name, None)
            if hasattr(data, "time"):
                return float(data.time)
    raise AttributeError(f"{type(world).__name__} does not tell its time")


def main() -> None:
    """Measure and print."""
    module, name, budget_s = sys.argv[1], sys.argv[2], float(sys.argv[3])
    importlib.import_module(module)
    env = gymnasium.make(name)
    env.action_space.seed(0)
    env.reset(seed=0)
    before_s = simulated_s(env.unwrapped)
    env.step(env.action_space.sample())
    step_s = simulated_s(env.unwrapped) - before_s
    env.reset()
    steps = episodes = 0
    begin = time.process_time()
    while time.process_time() - begin < budget_s:
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        steps += 1
        if terminated or truncated:
            env.reset()
            episodes += 1
    rate = steps / (time.process_time() - begin)
    print(json.dumps({"real_time": rate * step_s, "steps": rate, "step_s": step_s, "episodes": episodes}))


if __name__ == "__main__":
    main()
