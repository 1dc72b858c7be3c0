"""Learning from a page: which bags, start, stop, go on, curves, runs beside each other, and playing one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.node import Node
from std_msgs.msg import UInt8MultiArray

from msrd_ros.bags.info import BagInfo, read_info
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.core.resources import shipped_bags
from msrd_ros.nodes.common import LATCHED
from msrd_ros.nodes.messages import bytes_to_message
from msrd_ros.recordings.episodes import ROBOT_KEY
from msrd_ros.recordings.library import BagLibrary
from msrd_ros.robots.default import DEFAULT_ROBOT
from msrd_ros.robots.robot import Robot
from msrd_ros.studio.control import Answer
from msrd_ros.studio.curves import Curves
from msrd_ros.studio.library import Library
from msrd_ros.studio.requests import Request
from msrd_ros.studio.runs import Runs, count_labels, link_bags
from msrd_ros.studio.training import Training
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from msrd_ros.table_tennis.strokes.training import POLICIES_FILE, StrokeTrainingConfig

MOST_BAGS, MOST_LABELS = 2000, 100
MOST_ITERATIONS, MOST_SEED = 10_000, 2**31 - 1
MOST_RUNS = 2
"""That are laid beside each other."""

Work = Callable[[], tuple[str, dict[str, Any]]]
"""Does something, and gives what is to be said of it and values for the page."""


@dataclass(frozen=True)
class LearnConfig:
    """What every training of a studio has in common.

    Attributes
    ----------
    robot, strategies
        As the parameters of the studio say.
    runs
        Folder of the runs.
    files
        Parameter files, for the trainer as well.
    """

    robot: str
    strategies: str
    runs: Path
    files: tuple[Path, ...] = ()


class Learn:
    """What a page may ask of training.

    Parameters
    ----------
    node
        Whose graph trainers are started into.
    config
        What they have in common.
    library
        The bags to learn from, beside those that come with the package.
    robot
        The arm that was taught.
    later
        Does what takes its time, one thing after the other, and answers then.

    Attributes
    ----------
    verbs
        What can be asked for, by name.
    """

    def __init__(
        self,
        node: Node,
        config: LearnConfig,
        library: Library,
        robot: Robot,
        later: Callable[[Answer, Work], None],
    ) -> None:
        self._config, self._library, self._robot = config, library, robot
        self._runs = Runs(config.runs)
        self._training = Training(node, config.files)
        self._curves: dict[str, Curves] = {}
        self._policy = node.create_publisher(UInt8MultiArray, "policy", LATCHED)
        works: Mapping[str, Callable[[Request], tuple[str, dict[str, Any]]]] = {
            "demonstrations": self._demonstrations,
            "train": self._train,
            "go_on": self._go_on,
            "end_training": lambda _: (self._training.ask_to_end(), {}),
            "runs": self._list_runs,
            "curves": self._read_curves,
            "play_run": self._play,
        }

        def verb(work: Callable[[Request], tuple[str, dict[str, Any]]]) -> Callable[[Request, Answer], None]:
            return lambda request, answer: later(answer, lambda: work(request))

        self.verbs = {name: verb(work) for name, work in works.items()}

    def state(self) -> dict[str, Any]:
        """How far training is; see `Training.state`."""
        return self._training.state()

    def close(self) -> None:
        """End a training in order."""
        self._training.close()

    # -- what is learned from ------------------------------------------------------------------

    def _demonstrations(self, _: Request) -> tuple[str, dict[str, Any]]:
        counts = {source: count_labels(self._bags(source)) for source in ("own", "shipped")}
        return "", {**counts, "name": self._runs.free_name(), "iterations": StrokeTrainingConfig.iterations}

    def _bags(self, source: str) -> list[BagInfo]:
        """Kept bags of this arm with a label: the library's own, or those that come with the package."""
        if source == "shipped" and self._robot.name != DEFAULT_ROBOT:
            return []
        try:
            found = BagLibrary.scan(shipped_bags() if source == "shipped" else self._library.folder).bags
        except UserError:
            return []  # nothing is recorded yet
        return [bag for bag in found if bag.kept and bag.label and self._is_of_this_arm(bag)]

    def _is_of_this_arm(self, bag: BagInfo) -> bool:
        try:
            self._robot.require(bag.custom_data.get(ROBOT_KEY, self._robot.name), str(bag.path))
        except UserError:
            return False
        return True

    def _chosen(self, request: Request) -> list[BagInfo]:
        """The bags that a page names: by label from either source, or one by one."""
        found = [
            bag
            for source in ("own", "shipped")
            if (labels := _labels(request, source))
            for bag in self._bags(source)
            if bag.label in labels
        ]
        found += [read_info(self._library.place(name)) for name in request.texts("bags", MOST_BAGS, 0)]
        chosen = list({bag.path.resolve(): bag for bag in found}.values())
        if not chosen:
            raise UserError(
                "nothing to learn from: choose labels here, or strokes in Strokes; record some first"
            )
        return chosen

    # -- start, stop, go on --------------------------------------------------------------------

    def _train(self, request: Request) -> tuple[str, dict[str, Any]]:
        self._training.require_free()
        run = self._runs.place(request.text("name") or self._runs.free_name())
        if run.exists():
            raise UserError(f"there is a run {run.name!r} already; give another name, or go on with it below")
        iterations = request.whole("iterations", 1, MOST_ITERATIONS)
        seed = request.whole("seed", 0, MOST_SEED)
        bags = self._chosen(request)
        folder = link_bags(run, bags)
        self._curves.pop(run.name, None)  # of a run of that name whose folder was removed
        self._start(run, {"bags": str(folder), "iterations": str(iterations), "seed": str(seed)})
        return f"{run.name} learns from {len(bags)} strokes", {"run": run.name}

    def _go_on(self, request: Request) -> tuple[str, dict[str, Any]]:
        self._training.require_free()
        about = self._runs.about(request.text("name"))
        if not about["goes_on"]:
            raise UserError(
                f"{about['name']} cannot go on here: only what was started in a studio and stopped before "
                "its last iteration can; start another run"
            )
        run = self._runs.find(about["name"])
        settings = {"iterations": about["planned"], "seed": about["seed"], "bags": run / "bags"}
        self._start(run, {**{name: str(value) for name, value in settings.items()}, "resume": "true"})
        return f"{run.name} goes on after iteration {about['iterations']}", {"run": run.name}

    def _start(self, run: Path, arguments: dict[str, str]) -> None:
        self._training.start(run, {"robot": self._config.robot, **arguments}, self._config.strategies)

    # -- what came of it -----------------------------------------------------------------------

    def _running(self) -> str:
        return self._training.run.name if self._training.runs else ""

    def _list_runs(self, _: Request) -> tuple[str, dict[str, Any]]:
        return "", {"runs": self._runs.all(self._running())}

    def _read_curves(self, request: Request) -> tuple[str, dict[str, Any]]:
        told = []
        for name in request.texts("runs", MOST_RUNS):
            run = self._runs.find(name)
            curves = self._curves.setdefault(name, Curves(run))
            told.append({**self._runs.about(name, name == self._running()), "curves": curves.read()})
        return "", {"runs": told}

    def _play(self, request: Request) -> tuple[str, dict[str, Any]]:
        run = self._runs.find(request.text("name"))
        policies = StrokePolicies.load(run / POLICIES_FILE, self._robot)
        if not self._policy.get_subscription_count():
            raise UserError("nobody plays policies: topic policy has no subscriber; start an executor")
        self._policy.publish(bytes_to_message(policies.to_bytes()))
        return f"{run.name} is played from the next stroke on: {', '.join(policies.labels)}", {}


def _labels(request: Request, source: str) -> list[StrategyLabel]:
    return [StrategyLabel.parse(text, source) for text in request.texts(source, MOST_LABELS, 0)]
