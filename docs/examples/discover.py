"""Two drivers who stop at a place of their own; whose a drive is, is known of some, and wrong of one."""

import numpy as np

import msrd_ros.learning as msrd

rng = np.random.default_rng(0)
observations, actions, labels = [], [], []
for number in range(12):
    driver = ("left", "right")[number % 2]
    goal = {"left": -1.0, "right": 1.0}[driver]
    states, pushes = [rng.normal(size=2)], []
    for _ in range(100):
        place, speed = states[-1]
        pushes.append([1.5 * (goal - place) - speed + 0.1 * rng.normal()])
        states.append(np.array([place + 0.1 * speed, speed + 0.1 * pushes[-1][0] + 0.1 * rng.normal()]))
    observations.append(states)
    actions.append(pushes)
    labels.append(driver if number < 6 else None)
labels[0] = "right"

found = msrd.discover(observations, actions, labels)
for name in found.names:
    print(name, [number for number, label in enumerate(found.labels) if label == name])
print("doubted:", found.doubted)

# To train with them: msrd.train(demonstrations, environment), or at once train(..., labels="discover").
demonstrations = msrd.demonstrations_from_arrays(observations, actions, found.labels)
print(demonstrations.strategies, "strategies")
