"""FLAIR's demonstrations: ten strategies of three trajectories each, from a file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.learning.demonstration_sets import demonstrations_from_arrays
from msrd_ros.learning.examples.lunar_lander import ACTION_NAMES, OBSERVATION_NAMES
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.studies.lunar_lander.environment import CONTROL_PERIOD_S

SHIPPED = Path(__file__).with_name("flair.npz")
"""Of github.com/CORE-Robotics-Lab/FLAIR, ``data/LunarLander10skills500.pkl``, as plain arrays; see NOTICE."""


@dataclass(frozen=True)
class Recipe:
    """What the demonstrations are.

    Attributes
    ----------
    digest
        Of the file.
    """

    digest: str


@dataclass(frozen=True)
class LanderDemonstrations:
    """Demonstrations as they were recorded; a `DemonstrationSource`.

    Attributes
    ----------
    observations
        ``[S, M, T, 8]``; row t is what was seen *after* action t.
    actions
        ``[S, M, T, 2]``.
    recipe
        Which file.
    """

    observations: NDArray[np.float32]
    actions: NDArray[np.float32]
    recipe: Recipe

    @property
    def truth(self) -> None:
        """Nobody knows what each strategy truly prefers."""
        return None

    @property
    def report(self) -> dict[str, Any]:
        """How many there are."""
        strategies, count, steps, _ = self.observations.shape
        return {"strategies": strategies, "demonstrations": count, "steps": steps}

    def demonstrate(self, count: int, seed: int = 0) -> Demonstrations:
        """The first `count` of each strategy, whatever the seed.

        Each action stands beside the state that it was taken at, which is the row before; the first one goes,
        for nobody recorded where it was taken.
        """
        strategies = len(self.observations)
        chosen = [(i, m) for i in range(strategies) for m in range(min(count, self.observations.shape[1]))]
        return demonstrations_from_arrays(
            [self.observations[place] for place in chosen],
            [self.actions[place][1:] for place in chosen],
            [f"strategy-{i + 1}" for i, _ in chosen],
            terminated=False,
            observation_names=OBSERVATION_NAMES,
            action_names=ACTION_NAMES,
            control_period_s=CONTROL_PERIOD_S,
        )


@cache
def load_demonstrations(path: Path = SHIPPED) -> LanderDemonstrations:
    """Read a file of arrays ``observations [S, M, T, 8]`` and ``actions [S, M, T, 2]``.

    Raises
    ------
    UserError
        If it cannot be read or holds something else.
    """
    try:
        data = path.read_bytes()
        with np.load(BytesIO(data), allow_pickle=False) as arrays:
            observations, actions = arrays["observations"], arrays["actions"]
    except OSError as error:
        raise UserError(f"--data {path}: cannot be read ({error.strerror})") from None
    except (KeyError, ValueError, EOFError, BadZipFile) as error:
        raise UserError(f"--data {path}: no npz file of observations and actions ({error})") from None
    expected = (*observations.shape[:3], len(OBSERVATION_NAMES)), (*observations.shape[:3], len(ACTION_NAMES))
    if observations.ndim != 4 or (observations.shape, actions.shape) != expected or observations.shape[2] < 3:
        raise UserError(
            f"--data {path}: observations {observations.shape} and actions {actions.shape}; expected "
            "[strategies, demonstrations, steps, 8] and [strategies, demonstrations, steps, 2]"
        )
    digest = sha256(data).hexdigest()[:12]
    return LanderDemonstrations(observations.astype(np.float32), actions.astype(np.float32), Recipe(digest))
