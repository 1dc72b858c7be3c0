"""Rates of a batch of balls: struck, returned, near the wanted landing point, told apart by spin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import Outcome
from msrd_ros.table_tennis.strategies.table import Strategies

LANDING_RADIUS_M = 0.20


@dataclass(frozen=True)
class Rate:
    """A share with its Wilson 95 % confidence interval."""

    count: int
    total: int
    low: float
    high: float

    @classmethod
    def of(cls, count: int, total: int) -> Rate:
        """Count successes; a total of zero gives the interval [0, 1]."""
        if total == 0:
            return cls(0, 0, 0.0, 1.0)
        interval = binomtest(count, total).proportion_ci(0.95, method="wilson")
        return cls(count, total, float(interval.low), float(interval.high))

    @property
    def share(self) -> float:
        """Successes over total; NaN for nothing."""
        return self.count / self.total if self.total else math.nan

    def __str__(self) -> str:
        if not self.total:
            return "-"
        return f"{100 * self.share:.0f} % [{100 * self.low:.0f}, {100 * self.high:.0f}]"


@dataclass(frozen=True)
class LabelRates:
    """What became of the balls of one strategy.

    Spin, landing points and targets are of returned balls only; spin about the y axis in rad/s, + is topspin.
    Where nobody judges the strategy's spin, `spin_class_right` is None; where all balls were to land at one
    place, `targets` is.
    """

    fed: int
    struck: Rate
    returned: Rate
    within_20cm: Rate
    spin_class_right: Rate | None
    spin_mean: float
    spin_sd: float
    landing_points: list[tuple[float, float]]
    spins: list[float]
    miss_reasons: dict[str, int]
    targets: list[tuple[float, float]] | None = None

    @classmethod
    def of(
        cls,
        label: StrategyLabel,
        outcomes: Sequence[Outcome],
        landing_point: NDArray[np.float64] | None,
        strategies: Strategies | None = None,
    ) -> LabelRates:
        """Rates of `outcomes`, all of one strategy.

        Parameters
        ----------
        label
            The strategy that was asked for.
        outcomes
            One per ball.
        landing_point
            Where balls are to land, m: one place for all, shape (2,), such as where the demonstrations landed
            on average, or a target for each, (n, 2); None or NaN where unknown.
        strategies
            Who judges spin; None takes the package's.
        """
        judge = strategies or Strategies.shipped()
        back = [outcome for outcome in outcomes if outcome.returned]
        spins = [outcome.spin_y_rad_s for outcome in back]
        points = [(outcome.landing_x_m, outcome.landing_y_m) for outcome in back]
        wanted = np.broadcast_to(math.nan if landing_point is None else landing_point, (len(outcomes), 2))
        known = bool(np.isfinite(wanted).all())
        targets = [(float(x), float(y)) for (x, y), one in zip(wanted, outcomes, strict=True) if one.returned]
        near = sum(math.dist(*pair) <= LANDING_RADIUS_M for pair in zip(points, targets, strict=True))
        reasons: dict[str, int] = {}
        for outcome in outcomes:
            if not outcome.returned:
                reasons[outcome.message] = reasons.get(outcome.message, 0) + 1
        return cls(
            len(outcomes),
            Rate.of(sum(outcome.struck for outcome in outcomes), len(outcomes)),
            Rate.of(len(back), len(outcomes)),
            Rate.of(near, len(back) if known else 0),
            None
            if judge.of(label).spin is None
            else Rate.of(sum(bool(judge.spin_is_right(label, spin)) for spin in spins), len(back)),
            float(np.mean(spins)) if spins else math.nan,
            float(np.std(spins)) if spins else math.nan,
            points,
            spins,
            reasons,
            None if landing_point is None or landing_point.ndim == 1 else targets,
        )

    def to_json(self) -> dict[str, Any]:
        """Counts as plain numbers, intervals beside them; what is NaN or not judged becomes None."""
        values = asdict(self)
        for name in ("struck", "returned", "within_20cm", "spin_class_right"):
            rate: Rate | None = getattr(self, name)
            values[name] = rate and rate.count
            values[f"{name}_share"] = rate and _none_if_nan(rate.share)
            values[f"{name}_interval"] = rate and [rate.low, rate.high]
        values["spin_mean"] = _none_if_nan(self.spin_mean)
        values["spin_sd"] = _none_if_nan(self.spin_sd)
        return values


def _none_if_nan(value: float) -> float | None:
    return None if math.isnan(value) else value


def format_table(rates: dict[str, LabelRates]) -> str:
    """A table for the terminal, one line per strategy."""
    width = max(18, *(len(label) + 2 for label in rates)) if rates else 18
    lines = [
        f"{'strategy':<{width}}{'fed':>5}  {'struck':<18}{'returned':<18}{'within 20 cm':<18}"
        f"{'spin rad/s':<14}spin class"
    ]
    for label, row in rates.items():
        spin = "-" if math.isnan(row.spin_mean) else f"{row.spin_mean:+.0f} +- {row.spin_sd:.0f}"
        lines.append(
            f"{label:<{width}}{row.fed:>5}  {row.struck!s:<18}{row.returned!s:<18}{row.within_20cm!s:<18}"
            f"{spin:<14}{row.spin_class_right or '-'}"
        )
    return "\n".join(lines)
