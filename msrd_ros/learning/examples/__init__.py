"""Demonstrations that ship with the package; the modules of the same names made them."""

from __future__ import annotations

from importlib.resources import files

import numpy as np

from msrd_ros.core.errors import UserError
from msrd_ros.learning.demonstration_sets import demonstrations_from_arrays
from msrd_ros.learning.trajectories import Demonstrations

EXAMPLES = ("lunar_lander",)


def example_demonstrations(name: str) -> Demonstrations:
    """Demonstrations of a task of `EXAMPLES`.

    Raises
    ------
    UserError
        If there is none of that name.
    """
    if name not in EXAMPLES:
        raise UserError(f"no example {name!r}; there are {', '.join(EXAMPLES)}")
    with (files(__package__) / f"{name}.npz").open("rb") as file, np.load(file) as arrays:
        keys = [key.partition("/")[2] for key in arrays if key.startswith("observations/")]
        return demonstrations_from_arrays(
            [arrays[f"observations/{key}"] for key in keys],
            [arrays[f"actions/{key}"] for key in keys],
            [key.partition("/")[0] for key in keys],
            terminated=True,
            observation_names=arrays["observation_names"].tolist(),
            action_names=arrays["action_names"].tolist(),
        )
