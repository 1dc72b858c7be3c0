"""What a page is told of a sketch, to draw it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.table_tennis.teachers.sketch import Moment
from msrd_ros.table_tennis.teachers.sketch_plan import SketchPlan

Array = NDArray[np.float64]

_POINTS = 80
"""Of a path."""


def sketch_view(plan: SketchPlan) -> dict[str, Any]:
    """A sketch and what comes of it, as JSON has it."""
    sketch = plan.sketch
    outcome = plan.prediction.outcome
    bad = {violation.ghost for violation in plan.violations}
    return {
        "name": str(sketch.strategy),
        "side": str(sketch.side),
        "ghosts": {
            str(moment): {
                "position": rounded(ghost.position),
                "normal": rounded(ghost.rotation[:, 1]),
                "blade": rounded(ghost.rotation[:, 2]),
                "bad": str(moment) in bad,
            }
            for moment, ghost in sketch.ghosts.items()
        },
        "contact_s": round(sketch.contact_s, 3),
        "swing_s": round(sketch.contact_s - plan.moments_s[Moment.WIND_UP], 3),
        "follow_s": round(plan.stroke.follow_s, 3),
        "paddle_path": _thinned(plan.paddle[:, :3]),
        "ball_path": _thinned(plan.prediction.path[:, :3]),
        "violations": [str(violation) for violation in plan.violations],
        "outcome": outcome.message,
        "returned": outcome.returned,
        "spin_rad_s": _known(outcome.spin_y_rad_s),
        "landing_m": [_known(outcome.landing_x_m), _known(outcome.landing_y_m)],
    }


def _thinned(rows: Array) -> list[list[float]]:
    places = np.linspace(0, len(rows) - 1, _POINTS).round().astype(int)
    return [rounded(row) for row in rows[places]]


def rounded(values: Array) -> list[float]:
    """Values (n,) in m or without unit, as precise as a page draws them."""
    return [round(float(value), 4) for value in values]


def _known(value: float) -> float | None:
    return round(float(value), 3) if np.isfinite(value) else None
