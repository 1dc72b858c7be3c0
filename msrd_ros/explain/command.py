"""`python -m msrd_ros explain`: what learned rewards say of a recorded stroke, or of two side by side."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch

from msrd_ros.bags.reader import Bag
from msrd_ros.contract.labels import say_label
from msrd_ros.core.errors import UserError
from msrd_ros.explain.comparison import Comparison, compare
from msrd_ros.explain.explanation import (
    UNCALIBRATED,
    Explanation,
    Rank,
    explain,
    fit_temperature,
    load_rewards,
    rank,
)
from msrd_ros.explain.figure import MOST_STROKES, require_format, write_figure
from msrd_ros.learning.learned import Learned
from msrd_ros.recordings.editing_command import add_reading_options, read_options
from msrd_ros.recordings.episodes import read_bags, read_episodes
from msrd_ros.recordings.library import BagLibrary
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.strategies.table import STRATEGIES_HELP, Strategies


class Told(NamedTuple):
    """What is told of one bag.

    Attributes
    ----------
    bag
        Where it lies.
    explained
        Its stroke.
    rank
        Where that stands among other returned ones of its label; None if there are none to ask.
    """

    bag: Path
    explained: Explanation
    rank: Rank | None


def main(argv: Sequence[str] | None = None) -> int:
    """Explain; 0, as what cannot be explained is an error of the user."""
    options = _parser().parse_args(argv)
    torch.set_num_threads(1)  # threads that share out networks this small wait for each other
    try:
        return _explain(options)
    except UserError as error:
        raise UserError(str(error).replace("robot:=", "--robot ")) from None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="explain", description=__doc__)
    parser.add_argument("bag", type=Path, nargs="+", metavar="BAG", help="a bag of one stroke; at most two")
    parser.add_argument(
        "--checkpoint",
        type=Path,
        required=True,
        metavar="FILE",
        help="checkpoint.safetensors of a training run, its folder, or what the library saved",
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="draw it: .svg or .png")
    parser.add_argument(
        "--among",
        type=Path,
        metavar="FOLDER",
        help="returned strokes to rank R0 among, and to calibrate with",
    )
    add_reading_options(parser)
    parser.add_argument("--strategies", default="", metavar="FILE", help=STRATEGIES_HELP)
    parser.add_argument("--json", action="store_true", help="print one object, and nothing else")
    return parser


def _explain(options: argparse.Namespace) -> int:
    if len(options.bag) > MOST_STROKES:
        raise UserError(f"{len(options.bag)} bags: give one, or two to lay beside each other")
    if options.out is not None:
        require_format(options.out)
    robot, names = read_options(options)
    strategies = Strategies.load(options.strategies)
    learned = load_rewards(options.checkpoint.expanduser(), robot)
    strokes = [_read(learned, bag, robot, names) for bag in options.bag]
    others = [] if options.among is None else _read_others(learned, options.among, options.bag, robot, names)
    temperature = fit_temperature(others) if others else UNCALIBRATED
    told = [
        Told(bag, stroke, _rank(stroke, others)) for bag, stroke in zip(options.bag, strokes, strict=True)
    ]
    compared = compare(*strokes) if len(strokes) == MOST_STROKES else None
    if options.json:
        print(json.dumps(as_json(told, compared, temperature), indent=1))
    else:
        labelled = sum(other.episode.label is not None for other in others)
        print(as_text(told, compared, temperature, labelled))
    if options.out is not None:
        write_figure(options.out, strokes, [one.title for one in strokes], strategies, temperature)
        if not options.json:
            print(f"drawn in {options.out}")
    return 0


def _read(learned: Learned, bag: Path, robot: Robot, names: Mapping[str, str]) -> Explanation:
    episodes = read_episodes(Bag(bag, names), robot)
    if len(episodes) > 1:
        raise UserError(
            f"bag {bag}: holds {len(episodes)} strokes; give a bag of one, as the recorder keeps it"
        )
    return explain(learned, episodes[0])


def _read_others(
    learned: Learned, among: Path, own: Sequence[Path], robot: Robot, names: Mapping[str, str]
) -> list[Explanation]:
    """The returned strokes of a folder but for those that are explained."""
    infos = [
        info for info in BagLibrary.scan(among).select() if not any(info.path.samefile(bag) for bag in own)
    ]
    found = [
        explain(learned, episode)
        for reading in read_bags(infos, robot, names, unlabelled=True)
        for episode in reading.episodes
    ]
    if not found:
        raise UserError(
            f"folder {among}: no other returned stroke; give another folder, or do without --among"
        )
    return found


def _rank(stroke: Explanation, others: Sequence[Explanation]) -> Rank | None:
    alike = [other for other in others if other.episode.label == stroke.episode.label]
    return rank(stroke, alike) if alike else None


def as_json(told: Sequence[Told], compared: Comparison | None, temperature: float) -> dict[str, Any]:
    """All numbers as plain data; lengths in m, times in s."""
    found: dict[str, Any] = {
        "labels": list(told[0].explained.labels),
        "temperature": temperature,
        "calibrated": temperature != UNCALIBRATED,
        "strokes": [_stroke_as_json(one, temperature) for one in told],
    }
    if compared is not None:
        found["comparison"] = {
            "time_since_hit_s": _numbers(compared.time_s),
            "ball_apart_m": _numbers(compared.ball_apart_m),
            "paddle_apart_m": _numbers(compared.paddle_apart_m),
            "task_reward": _numbers(compared.task),
            "strategy_rewards": _numbers(compared.strategy),
        }
    return found


def _stroke_as_json(one: Told, temperature: float) -> dict[str, Any]:
    explained, episode = one.explained, one.explained.episode
    return {
        "bag": str(one.bag),
        "label": say_label(episode.label),
        "subject": episode.subject,
        "outcome": None if episode.outcome is None else episode.outcome.message,
        "struck": explained.struck,
        "hit_s": round(explained.hit_s, 4),
        "task_reward_mean": explained.mean_task,
        "rank": None if one.rank is None else one.rank._asdict(),
        "posterior": dict(zip(explained.labels, explained.posterior(temperature).tolist(), strict=True)),
        "evidence": dict(zip(explained.labels, explained.evidence.tolist(), strict=True)),
        "time_s": _numbers(explained.time_s),
        "ball_m": _numbers(explained.ball),
        "paddle_m": _numbers(explained.paddle),
        "task_reward": _numbers(explained.task),
        "strategy_rewards": _numbers(explained.strategy),
    }


def _numbers(values: Any) -> Any:
    return np.round(values, 6).tolist()


def as_text(told: Sequence[Told], compared: Comparison | None, temperature: float, others: int) -> str:
    """The same for people, without the single steps; `others` is how many strokes it was calibrated with."""
    how = f"calibrated with {others} strokes, temperature {temperature:.3g}"
    if temperature == UNCALIBRATED:
        how = "not calibrated; " + ("training knows those of --among too well" if others else "see --among")
    lines: list[str] = []
    for one in told:
        explained = one.explained
        shares = explained.posterior(temperature)
        named = ", ".join(f"{explained.labels[row]} {shares[row]:.1%}" for row in np.argsort(-shares))
        lines += [f"{one.bag}: {explained.title}", f"  whose stroke is it: {named} ({how})"]
        if one.rank is not None:
            lines.append(
                f"  R0 is above that of {one.rank.above} of {one.rank.of} other returned strokes of "
                f"{say_label(explained.episode.label)}"
            )
    if compared is not None:
        at_hit = int(np.abs(compared.time_s).argmin())
        higher = float((compared.task[1] - compared.task[0]).mean())
        lines.append(
            f"with their hits at the same time: paddles {compared.paddle_apart_m[at_hit]:.3f} m apart then, "
            f"{compared.paddle_apart_m.max():.3f} m at most, balls {compared.ball_apart_m.max():.3f} m; R0 "
            f"of the second is {higher:+.3f} a step higher"
        )
    return "\n".join(lines)
