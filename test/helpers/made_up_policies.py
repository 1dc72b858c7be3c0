"""Stroke policies made up for tests: small random networks with the layout of the package's strokes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.learning.policy import PolicySet
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS, PaperLabel
from msrd_ros.table_tennis.strokes.policies import StrokeFacts, StrokePolicies, stroke_layout
from msrd_ros.table_tennis.strokes.reach import Reach
from msrd_ros.table_tennis.teachers.planner import planned_strokes
from sawyer import ROBOT

HIDDEN = 8


def made_up_policies(
    labels: Sequence[PaperLabel] = ALL_LABELS,
    gain: float = 0.3,
    log_std: float = -1.0,
    seed: int = 0,
    reach: Reach | None = None,
) -> StrokePolicies:
    """Policies that move the arm about smoothly from the planned strokes' ready poses.

    Parameters
    ----------
    labels
        Strategies.
    gain
        Size of the outgoing weights: about the speed fraction they ask for.
    log_std
        Natural logarithm of the exploration's standard deviation.
    seed
        Of the weights.
    reach
        Of every strategy; None makes policies that take no target.
    """
    rng = np.random.default_rng(seed)
    layout = stroke_layout(ROBOT, labels, takes_target=reach is not None)
    count, seen, said = len(labels), len(layout.observation_names), len(layout.action_names)
    tensors = {
        "weight/0": rng.normal(size=(count, seen, HIDDEN)).astype(np.float32),
        "bias/0": rng.normal(size=(count, 1, HIDDEN)).astype(np.float32),
        "weight/1": (gain / HIDDEN**0.5 * rng.normal(size=(count, HIDDEN, said))).astype(np.float32),
        "bias/1": np.zeros((count, 1, said), np.float32),
        "log_std": np.full((count, 1, said), log_std, np.float32),
        "indices": np.arange(seen),
        "offset": np.zeros(seen, np.float32),
        "scale": np.full(seen, 3.0, np.float32),
    }
    planned = planned_strokes()
    facts: dict[StrategyLabel, StrokeFacts] = {
        label: StrokeFacts(planned[label].start.position, np.array([0.9, 0.1 * index]), label.side, reach)
        for index, label in enumerate(labels)
    }
    return StrokePolicies(PolicySet(layout, tensors, {"method": "made up"}), facts)


def with_columns(policies: StrokePolicies, **columns: object) -> StrokePolicies:
    """The same policies under another layout, for refusals."""
    layout = replace(policies.policies.layout, **columns)  # type: ignore[arg-type]
    return replace(policies, policies=replace(policies.policies, layout=layout))
