"""Three drivers are known, who stop at places of their own; then two more come by."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import msrd_ros.learning as msrd

Array = NDArray[np.floating]

rng = np.random.default_rng(0)


class Road:
    """A car on a straight road: place and speed; pushes between -1 and 1."""

    observation_names, action_names = ("place", "speed"), ("push",)
    horizon = acting_steps = 60

    def reset(self, strategies: int, episodes: int, rng: np.random.Generator) -> Array:
        """Everyone begins near the middle."""
        self.state: Array = 0.1 * rng.normal(size=(strategies, episodes, 2))
        return self.state

    def step(self, action: Array) -> Array:
        """Push for a moment."""
        place, speed = self.state[..., 0], self.state[..., 1]
        speed = 0.9 * speed + 0.3 * np.clip(action[..., 0], -1.0, 1.0)
        self.state = np.stack([place + 0.2 * speed, speed], axis=-1)
        return self.state


def drive(goal: float) -> tuple[Array, Array]:
    """What a driver shows who stops at a place."""
    road = Road()
    seen, done = [road.reset(1, 1, rng)[0, 0]], []
    for _ in range(road.horizon):
        done.append(np.clip(1.5 * (goal - seen[-1][:1]) - seen[-1][1:] + 0.1 * rng.normal(size=1), -1.0, 1.0))
        seen.append(road.step(done[-1][None, None])[0, 0])
    return np.stack(seen), np.stack(done)


goals = {"left": -1.0, "middle": 0.0, "right": 1.0}
drives = [(*drive(goal), name) for name, goal in goals.items() for _ in range(10)]
observations, actions, labels = map(list, zip(*drives, strict=True))
demonstrations = msrd.demonstrations_from_arrays(
    observations, actions, labels, None, Road.observation_names, Road.action_names
)
recipe = replace(msrd.default_config(restarts=False), iterations=10)
learned = msrd.train(demonstrations, Road(), config=recipe, progress=False)

newcomers = msrd.Newcomers(learned, demonstrations, Road(), recipe)
for name, goal in (("again-right", 1.0), ("far", 4.0)):
    seen, done = drive(goal)
    meeting = newcomers.meet([seen], [done], name)
    print(f"{name}: {meeting.recognition}; {meeting.episodes} episodes")
print("strategies:", *newcomers.learned.labels)
print("mixtures:", newcomers.mixtures)
