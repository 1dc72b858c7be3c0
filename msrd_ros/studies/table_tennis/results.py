"""From played balls to the numbers of ``metrics.json``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.reports.film import film_of
from msrd_ros.studies.table_tennis.playing import Played
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strokes.rates import LabelRates, Rate

COUNTS = ("fed", "struck", "returned", "within_20cm", "spin_class_right")
MEASURES = ("spin_mean", "spin_sd")


def evaluation_report(
    played: Played, balls: int, landing_points: Mapping[StrategyLabel, NDArray[np.float64]]
) -> dict[str, Any]:
    """Rates by label, and the joints' limits, of `balls` balls for each label in order."""
    rates = {}
    for index, label in enumerate(ALL_LABELS):
        outcomes = played.outcomes[index * balls : (index + 1) * balls]
        rates[str(label)] = LabelRates.of(label, outcomes, landing_points.get(label)).to_json()
    return {"rates": rates, "limits": played.limits._asdict()}


def save_films(folder: Path, films: Mapping[StrategyLabel, Episode]) -> None:
    """One strip of frames for each stroke."""
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    for label, episode in films.items():
        Image.fromarray(film_of(episode)).save(folder / f"{label}.png")


def label_metrics(rates: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """One label's numbers: lists by training seed, and shares with Wilson intervals by seed and pooled."""
    found: dict[str, Any] = {name: [row[name] for row in rates] for name in (*COUNTS, *MEASURES)}
    found["miss_reasons"] = [row["miss_reasons"] for row in rates]
    found["intervals"] = {
        name: [row[f"{name}_interval"] for row in rates] for name in COUNTS if name != "fed"
    }
    found["pooled"] = {
        name: pooled(found[name], found["fed" if name in ("struck", "returned") else "returned"])
        for name in COUNTS
        if name != "fed"
    }
    return found


def pooled(counts: Sequence[int], totals: Sequence[int]) -> dict[str, Any]:
    """Successes of all seeds together, with the Wilson 95 % interval."""
    rate = Rate.of(sum(counts), sum(totals))
    share = rate.share if rate.total else None
    return {"count": rate.count, "total": rate.total, "share": share, "interval": [rate.low, rate.high]}


def method_metrics(rows: Sequence[Mapping[str, Any]], labels: Sequence[str]) -> dict[str, Any]:
    """One method's numbers, lists by training seed."""
    found: dict[str, Any] = {
        "labels": {label: label_metrics([row["rates"][label] for row in rows]) for label in labels},
        "training_seconds": [row.get("seconds", 0.0) for row in rows],
        "training_cpu_seconds": [row.get("cpu_seconds", 0.0) for row in rows],
        "env_steps": [row.get("env_steps", 0) for row in rows],
        "curves": [row.get("curve", []) for row in rows],
        "limits": [row["limits"] for row in rows],
        "spins": {label: [spin for row in rows for spin in row["rates"][label]["spins"]] for label in labels},
        "diagonal": [row.get("diagonal") for row in rows],
        "strategy_rewards": rows[0].get("strategy_rewards"),
        "matrix": [row.get("matrix") for row in rows],
        "undone": None,
    }
    if "undone" in rows[0]:
        judged = [row["undone"] for row in rows]
        names = ("real", "undone", "share_in_order", "friedman_chi2")
        found["undone"] = {name: [one[name] for one in judged] for name in names}
        # The least convincing seed speaks for all.
        found["undone"]["friedman_p"] = max(one["friedman_p"] for one in judged)
    return found


def robustness_metrics(rows: Mapping[str, Sequence[Any]], labels: Sequence[str]) -> dict[str, Any]:
    """By condition: every label's numbers, lists by training seed, and the limits."""
    return {
        name: {
            "labels": {label: label_metrics([row["rates"][label] for row in found]) for label in labels},
            "limits": [row["limits"] for row in found],
        }
        for name, found in rows.items()
    }
