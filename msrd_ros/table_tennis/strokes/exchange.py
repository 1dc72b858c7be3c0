"""Which policy of which strategy is played: exchanged between strokes only."""

from __future__ import annotations

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.strokes.player import StrokePlayer
from msrd_ros.table_tennis.strokes.policies import StrokeDraws, StrokePolicies


class PolicyExchange:
    """Holds the policies in force, those that have arrived, and the strategy that is wanted.

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
    """

    def __init__(self, seed: int, ready_noise_rad: float) -> None:
        self._seed, self._ready_noise_rad = seed, ready_noise_rad
        self.policies: StrokePolicies | None = None
        self.arriving: StrokePolicies | None = None
        self.strategy: StrategyLabel | None = None
        self.wanted: StrategyLabel | None = None
        self._strokes = 0
        self._swapped_at = 0

    @property
    def digest(self) -> str:
        """Of the policies in force; empty without any."""
        return self.policies.digest if self.policies else ""

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
        if not swapped and not finished and self.wanted == self.strategy:
            return False
        try:
            facts = self.policies.require(self.wanted)
        except UserError:
            self.wanted = None
            raise
        self.strategy = self.wanted
        self._strokes = player.strokes_begun
        if swapped:
            self._swapped_at = self._strokes
        exploring = self.policies.exploration_seed
        seed, noise_rad = self._seed, self._ready_noise_rad
        if exploring is not None:
            seed, noise_rad = exploring, self.policies.ready_noise_rad
        draws = StrokeDraws.of(seed, self._strokes - self._swapped_at, self.policies.robot.joint_count)
        policy = self.policies.play(self.wanted, draws)
        player.prepare(policy, facts.ready_pose + noise_rad * draws.ready)
        return True
