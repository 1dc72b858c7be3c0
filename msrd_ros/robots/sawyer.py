"""The Rethink Sawyer's joints: names and published limits, in the order used everywhere.

Source: Rethink Robotics, sawyer_description (Apache-2.0).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def _constant(*values: float) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


JOINT_NAMES: tuple[str, ...] = tuple(f"right_j{index}" for index in range(7))
JOINT_COUNT = len(JOINT_NAMES)

POSITION_LOWER_RAD = _constant(-3.0503, -3.8095, -3.0426, -3.0439, -2.9761, -2.9761, -4.7124)
POSITION_UPPER_RAD = _constant(3.0503, 2.2736, 3.0426, 3.0439, 2.9761, 2.9761, 4.7124)
SPEED_LIMIT_RAD_S = _constant(1.74, 1.328, 1.957, 1.957, 3.485, 3.485, 4.545)
TORQUE_LIMIT_NM = _constant(80.0, 80.0, 40.0, 40.0, 9.0, 9.0, 9.0)

HOME_POSTURE_RAD = _constant(0.0, -1.18, 0.0, 2.18, 0.0, 0.57, 3.3161)
"""The published neutral posture."""
