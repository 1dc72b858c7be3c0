"""What strategy rewards see of the arm: the paddle, which all arms have, in place of joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from msrd_ros.contract.episode import CONTROL_PERIOD_S, PADDLE_NAMES
from msrd_ros.core.compiled import njit
from msrd_ros.robots.arm_model import Arm
from msrd_ros.robots.kinematics import place_paddle
from msrd_ros.robots.robot import Robot

Array = NDArray[np.float64]


@njit(cache=True, nogil=True)
def _fill(arm: Arm, before: Array, after: Array, period_s: float, columns: Array) -> None:
    place, rotation, earlier = np.empty(3), np.empty((3, 3)), np.empty(3)
    for row in range(len(after)):
        place_paddle(arm, before[row], earlier, rotation)
        place_paddle(arm, after[row], place, rotation)
        for axis in range(3):
            columns[row, axis] = place[axis]
            columns[row, 3 + axis] = rotation[axis, 1]
            columns[row, 6 + axis] = (place[axis] - earlier[axis]) / period_s


@dataclass(frozen=True)
class PaddleColumns:
    """`DerivedColumns` of strokes: `PADDLE_NAMES`, through the robot's kinematics.

    The velocity is that of the centre from one observation to the next, as the ball's is: joint rates are
    measured otherwise on every arm. How the blade turns is left out, for what the ball feels of it is small,
    and a turn about its normal would be nothing but another arm's way to hold it.

    Attributes
    ----------
    robot
        The arm, of N joints, whose angles are the first columns of an observation.
    """

    robot: Robot

    @property
    def names(self) -> tuple[str, ...]:
        """`PADDLE_NAMES`."""
        return PADDLE_NAMES

    def __call__(self, before: Tensor, after: Tensor) -> Tensor:
        """Of observations ``[..., O]``, one control period apart, ``[..., 9]``."""
        joints = self.robot.joint_count
        earlier, later = (
            np.ascontiguousarray(seen[..., :joints].detach().numpy().reshape(-1, joints), dtype=np.float64)
            for seen in (before, after)
        )
        columns = np.empty((len(later), len(PADDLE_NAMES)))
        _fill(self.robot.model, earlier, later, CONTROL_PERIOD_S, columns)
        return torch.as_tensor(columns, dtype=torch.float32).reshape(*after.shape[:-1], -1)

    def __deepcopy__(self, memo: dict[int, object]) -> PaddleColumns:
        """Itself: nothing of it ever changes, and rewards are copied often."""
        return self
