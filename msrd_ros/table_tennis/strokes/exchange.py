"""Which policy of which strategy is played: exchanged between strokes only."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.strokes.player import StrokePlayer
from msrd_ros.table_tennis.strokes.policies import StrokeDraws, StrokeFacts, StrokePolicies


class PolicyExchange:
    """Holds the policies in force, those that have arrived, and the strategy and target that are wanted.

    Parameters
    ----------
    seed, ready_noise_rad
        Of the start postures, unless the policies bring their own for exploring.

    Attributes
    ----------
    policies, strategy
        In force; None before the first.
    arriving, wanted
        What is taken up between strokes.
    target
        Where the ball of the next stroke is to land, (2,), m; None leaves it to the strategy.
    refusal
        Why there is no target although one is wanted; empty otherwise.
    """

    def __init__(self, seed: int, ready_noise_rad: float) -> None:
        self._seed, self._ready_noise_rad = seed, ready_noise_rad
        self.policies: StrokePolicies | None = None
        self.arriving: StrokePolicies | None = None
        self.strategy: StrategyLabel | None = None
        self.wanted: StrategyLabel | None = None
        self.target: NDArray[np.float64] | None = None
        self.refusal = ""
        self._wanted_target: NDArray[np.float64] | None = None
        self._is_aimed = True
        self._strokes = 0
        self._swapped_at = 0

    @property
    def digest(self) -> str:
        """Of the policies in force; empty without any."""
        return self.policies.digest if self.policies else ""

    def aim(self, target: NDArray[np.float64] | None, refusal: str = "") -> None:
        """Want balls to land there, (2,), m, from the next stroke on; None: where the strategy has them.

        Parameters
        ----------
        refusal
            Why it is None although something else was wanted.
        """
        self._wanted_target, self.refusal = target, refusal
        self._is_aimed = False

    def swap(self, player: StrokePlayer) -> bool:
        """Put policies in force that have arrived, if the arm is between strokes; whether there were any."""
        if self.arriving is None or not player.between_strokes:
            return False
        self.policies, self.arriving = self.arriving, None
        return True

    def prepare(self, player: StrokePlayer, swapped: bool) -> bool:
        """Have the arm make ready for the next stroke; whether there was anything new to prepare.

        Raises
        ------
        UserError
            If the policies in force do not have the strategy wanted; the present one stays.
        """
        if not player.between_strokes or self.wanted is None or self.policies is None:
            return False
        finished = player.strokes_begun != self._strokes
        begins = swapped or finished or self.wanted != self.strategy
        if not begins and self._is_aimed:
            return False
        try:
            facts = self.policies.require(self.wanted)
        except UserError:
            self.wanted = None
            raise
        self.strategy = self.wanted
        self._choose_target(facts)
        self._strokes = player.strokes_begun
        if swapped:
            self._swapped_at = self._strokes
        exploring = self.policies.exploration_seed
        seed, noise_rad = self._seed, self._ready_noise_rad
        if exploring is not None:
            seed, noise_rad = exploring, self.policies.ready_noise_rad
        draws = StrokeDraws.of(seed, self._strokes - self._swapped_at, self.policies.robot.joint_count)
        policy = self.policies.play(self.wanted, draws, self.target)
        if begins:
            player.prepare(policy, facts.ready_pose + noise_rad * draws.ready)
        else:
            player.take(policy)
        return True

    def _choose_target(self, facts: StrokeFacts) -> None:
        """Take up the target that is wanted, if it is in reach of the strategy."""
        self.target, self._is_aimed = None, True
        if self._wanted_target is None:
            return
        try:
            facts.require_reach(self._wanted_target, str(self.strategy))
        except UserError as error:
            self.refusal = str(error)
            return
        self.target, self.refusal = self._wanted_target, ""
