"""Learn from arrays, in an environment of Gymnasium: a short run that shows the calls, not a good result."""

import gymnasium
import numpy as np

import msrd_ros.learning as msrd

ENVIRONMENT = "Pendulum-v1"
observations, actions, labels = [], [], []
with gymnasium.make(ENVIRONMENT, max_episode_steps=50) as environment:
    for seed in range(4):
        push = 1.0 if seed % 2 else -1.0
        seen = [environment.reset(seed=seed)[0]]
        done: list[list[float]] = []
        for step in range(50):
            done.append([push * float(np.sin(step / 5))])
            seen.append(environment.step(np.array(done[-1], dtype=np.float32))[0])
        observations.append(np.array(seen))
        actions.append(np.array(done))
        labels.append("left-first" if push < 0 else "right-first")
demonstrations = msrd.demonstrations_from_arrays(observations, actions, labels, terminated=False)
print(demonstrations.strategies, "strategies")
