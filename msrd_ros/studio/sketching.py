"""A stroke as it is sketched on a page: ghosts that are moved about, and at once what comes of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.robots.robot import Robot
from msrd_ros.robots.rotations import turned
from msrd_ros.studio.ghosts import Ghosts
from msrd_ros.studio.requests import Request
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.trajectory import path_at
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.default_sketch import default_sketch
from msrd_ros.table_tennis.teachers.side import PATH_PERIOD_S, feed_path
from msrd_ros.table_tennis.teachers.sketch import LONGEST_S, SHORTEST_S, Ghost, Moment, Sketch
from msrd_ros.table_tennis.teachers.sketch_plan import SketchPlan, plan_sketch

Array = NDArray[np.float64]

_REACH_M = 3.5
_SNAP_S = 0.15
"""So far the contact is shifted in time to where the ball comes nearest to the ghost."""


class Sketching:
    """The sketch that a page draws.

    Parameters
    ----------
    robot
        The arm that is to be led.
    ghosts
        What of it stands in the scene.

    Attributes
    ----------
    plan
        What comes of it; None before the first sketch.
    """

    def __init__(self, robot: Robot, ghosts: Ghosts) -> None:
        self._robot, self._ghosts = robot, ghosts
        self._found: dict[Side, Sketch] = {}
        self.plan: SketchPlan | None = None

    @property
    def sketch(self) -> Sketch:
        """As it stands.

        Raises
        ------
        UserError
            If none has been begun.
        """
        return self._require_begun().sketch

    def require_plan(self) -> SketchPlan:
        """What is to be led.

        Raises
        ------
        UserError
            If nothing is sketched, or the arm cannot do it; tells which joint, and by how much.
        """
        plan = self._require_begun()
        plan.require_possible()
        return plan

    def _require_begun(self) -> SketchPlan:
        if self.plan is None:
            raise UserError("nothing is sketched yet; give the stroke a name, and press Begin")
        return self.plan

    def begin(self, label: StrategyLabel, side: Side) -> str:
        """Begin with a stroke that returns the usual ball of a side; takes seconds the first time."""
        if side not in self._found:
            self._found[side] = default_sketch(self._robot, side)
        self._take(replace(self._found[side], strategy=label))
        return f"{label}: a stroke to begin with; drag its paddles"

    def hide(self) -> None:
        """Show it no more in the scene."""
        self._ghosts.hide()

    def rename(self, label: StrategyLabel) -> None:
        """Call it otherwise."""
        self._take(replace(self.sketch, strategy=label))

    def move(self, request: Request) -> None:
        """Put a ghost elsewhere, in m of `world`, and turn it about the axes y and z by some rad."""
        moment = Moment(request.choice("moment", tuple(Moment)))
        place = np.array([request.within(axis, -_REACH_M, _REACH_M, "m") for axis in "xyz"])
        turn = np.array([0.0, *(request.within(f"turn_{axis}", -np.pi, np.pi, "rad") for axis in "yz")])
        sketch = self.sketch
        ghost = Ghost.of(place, turned(sketch.ghosts[moment].rotation, turn))
        moved = sketch.with_ghosts({moment: ghost})
        if moment is Moment.CONTACT:
            moved = replace(moved, contact_s=_nearest_s(moved))
        self._take(moved)

    def time(self, request: Request) -> None:
        """Say how long the swing and the follow-through take, and when the ball is met, in s."""
        swing_s, follow_s = (request.within(name, SHORTEST_S, LONGEST_S, "s") for name in ("swing", "follow"))
        contact_s = request.within("contact", swing_s, 2.0, "s")
        self._take(replace(self.sketch, swing_s=swing_s, follow_s=follow_s, contact_s=contact_s))

    def _take(self, sketch: Sketch) -> None:
        """Plan it; the arm waits in the wind-up, wherever that is drawn, in a posture like the one before."""
        wind_up = plan_sketch(self._robot, sketch).stroke.start.position
        self.plan = plan_sketch(self._robot, replace(sketch, ready_rad=tuple(map(float, wind_up))))
        self._ghosts.show(self.plan)


def _nearest_s(sketch: Sketch) -> float:
    """When the ball comes nearest to the contact's ghost, near the moment that was meant."""
    path = feed_path(sketch.feed, Scene().constants())
    times = sketch.contact_s + np.arange(-_SNAP_S, _SNAP_S, PATH_PERIOD_S)
    times = times[(times > (sketch.swing_s or SHORTEST_S)) & (times < len(path) * PATH_PERIOD_S - 0.01)]
    if not len(times):
        return sketch.contact_s
    ways = [
        np.linalg.norm(path_at(path, PATH_PERIOD_S, time)[:3] - sketch.contact.position) for time in times
    ]
    return float(times[int(np.argmin(ways))])
