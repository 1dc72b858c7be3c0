"""The table tennis study from start to end, resumable: every run leaves a folder that is not run again.

Seeds are kept apart: training k draws from seed 1000 + k, its evaluation balls from stream
`EVALUATION_STREAM` with seed 4000 + k, and nothing was tuned on either.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from msrd_ros.cluster.workers import Workers
from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.resources import shipped_bags
from msrd_ros.studies.shared.cache import cache_key, cached
from msrd_ros.studies.table_tennis.judging import judge, undone_pairs
from msrd_ros.studies.table_tennis.learned_runs import TRAINING_SEED, LearnedRuns
from msrd_ros.studies.table_tennis.live import (
    Lesson,
    LivePlan,
    exchange_while_playing,
    learn_with_rollouts,
)
from msrd_ros.studies.table_tennis.methods import (
    MAIN_METHODS,
    METHODS,
    SUPPLEMENT,
    Budget,
    make_training,
    run_settings,
)
from msrd_ros.studies.table_tennis.playing import (
    Conditions,
    LearnedStrokes,
    Played,
    Repertoire,
    ReplayedMotions,
    evaluation_balls,
    play_balls,
)
from msrd_ros.studies.table_tennis.recording import Progress, StudyData, load_episodes, record, split
from msrd_ros.studies.table_tennis.results import (
    evaluation_report,
    method_metrics,
    robustness_metrics,
    save_films,
)
from msrd_ros.studies.table_tennis.robustness import robustness_conditions
from msrd_ros.table_tennis.simulation.changes import CHANGES
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strokes.policies import StrokePolicies

EVALUATION_SEED, ROBUSTNESS_SEED = 4000, 5000
ROBUST = ("msrd", "behaviour_cloning", "cloning_with_noise", "msrd_randomised")
"""Methods that are played under all conditions."""


def file_name(condition: str) -> str:
    """A condition's name in letters, digits and underscores; different for different names."""
    spelled = condition.replace("+", "plus ").replace("-", "minus ")
    return "".join(c if c.isalnum() else "_" for c in spelled)


@dataclass(frozen=True)
class StudyPlan:
    """What to run.

    Attributes
    ----------
    seeds
        Training seeds.
    subjects, recordings
        Of the recorded study; 0 subjects takes the bags that the package ships instead.
    held_out
        Subjects kept from training.
    budget
        What each method may use.
    balls, robustness_balls
        Evaluation balls per label and training seed; the latter for every row of the robustness table.
    methods, supplement
        Rows of the table; the supplement comes last and on the first seed only.
    conditions
        Rows of the robustness table; None takes all.
    robust
        Methods that are played under all conditions; those of the supplement on the first seed only.
    live
        What is learned and played over topics; None leaves it out.
    """

    seeds: int = 3
    subjects: int = 10
    recordings: int = 3
    held_out: int = 2
    budget: Budget = field(default_factory=Budget)
    balls: int = 200
    robustness_balls: int = 40
    methods: tuple[str, ...] = MAIN_METHODS
    supplement: tuple[str, ...] = SUPPLEMENT
    conditions: tuple[str, ...] | None = None
    robust: tuple[str, ...] = ROBUST
    live: LivePlan | None = field(default_factory=LivePlan)

    @classmethod
    def quick(cls) -> StudyPlan:
        """A small version for a first look and for the tests: shipped bags, one seed, few balls."""
        return cls(
            seeds=1,
            subjects=0,
            held_out=1,
            budget=Budget(
                iterations=2,
                plain_iterations=2,
                episodes=40,
                cloning_steps=400,
                evaluate_every=2,
                evaluation_balls=40,
            ),
            balls=4,
            robustness_balls=1,
            supplement=(),
            conditions=("60 Hz, 3 mm, 20 ms, 10 % lost, estimator", CHANGES["payload"].title),
            robust=("msrd", "cloning_with_noise"),
            live=None,
        )


class Study:
    """One study in one folder.

    Parameters
    ----------
    plan
        What to run.
    folder
        Bags, logs, runs and films go below it.
    workers
        Who trains and plays; results do not depend on them.
    progress
        Told what is going on, line by line.
    """

    def __init__(self, plan: StudyPlan, folder: Path, workers: Workers, progress: Progress) -> None:
        self.plan = plan
        self._workers = workers
        self._runs = folder / "runs"
        self._films = folder / "films"
        self._progress = progress
        self._bags = shipped_bags()
        if plan.subjects:
            self._bags = folder / "bags"
            record(self._bags, folder / "logs", plan.subjects, plan.recordings, progress)
        self.data: StudyData = split(load_episodes(self._bags, progress), plan.held_out)
        self._pairs = undone_pairs(self.data, 0)
        self._learned = LearnedRuns(self.data, plan.budget, self._runs)

    def run(self) -> dict[str, Any]:
        """Everything; the content of ``metrics.json``."""
        plan = self.plan
        wanted = [(method, seed) for seed in range(plan.seeds) for method in ("msrd", *plan.methods)]
        wanted += [(method, 0) for method in plan.supplement]
        self._learned.prepare(self._workers, wanted, self._progress)
        rows: dict[str, list[dict[str, Any]]] = {}
        for seed in range(plan.seeds):
            for method in plan.methods:
                rows.setdefault(method, []).append(self._row(method, seed))
        robustness = {
            method: self._robustness(method, range(1 if method in plan.supplement else plan.seeds))
            for method in plan.robust
        }
        for method in plan.supplement:
            rows.setdefault(method, []).append(self._row(method, 0))
        over_topics = self._over_topics(plan.live) if plan.live else {}
        labels = [str(label) for label in ALL_LABELS]
        methods = {method: method_metrics(found, labels) for method, found in rows.items()}
        if "frozen_reward" in methods and "behaviour_cloning" in methods:
            # Same seed, same cloning: its policies are the ones that the frozen rewards then improve.
            for label, row in methods["frozen_reward"]["labels"].items():
                start = methods["behaviour_cloning"]["labels"][label]
                row["returned_at_start"] = start["returned"]
        return {
            "study": "table_tennis",
            "seeds": list(range(plan.seeds)),
            "labels": labels,
            "methods": methods,
            "robustness": {method: robustness_metrics(found, labels) for method, found in robustness.items()},
            **over_topics,
            "subjects": {
                name: sorted({episode.subject for episode in part})
                for name, part in (("training", self.data.training), ("held_out", self.data.held_out))
            },
            "plan": asdict(plan),
        }

    def _row(self, method: str, seed: int) -> dict[str, Any]:
        """All about one method and training seed, from its folder or anew."""
        folder = self._learned.folder(method, seed)
        result: dict[str, Any] = {}
        repertoire: Repertoire
        if METHODS[method].learns is None:
            groups: dict[StrategyLabel, list[Episode]] = {
                label: [e for e in self.data.training if e.label == label] for label in ALL_LABELS
            }
            repertoire = ReplayedMotions(groups)
        else:
            learned = self._learned.take(method, seed)
            repertoire = LearnedStrokes(learned.policies)
            result |= learned.report
            if learned.rewards:
                training = make_training(METHODS[method], self.data, self.plan.budget, TRAINING_SEED + seed)
                result |= judge(training, learned.rewards, self.data, self._pairs)

        def play() -> dict[str, Any]:
            self._progress(f"{method} seed {seed}: plays {self.plan.balls} balls of each stroke")
            played = self._play(repertoire, self.plan.balls, EVALUATION_SEED + seed, Conditions())
            if method == "msrd" and seed == 0:
                save_films(self._films, played.films)
            return evaluation_report(played, self.plan.balls, self.data.landing_points)

        return result | cached(folder / f"evaluation-{self.plan.balls}.json", play)

    def _robustness(self, method: str, seeds: Sequence[int]) -> dict[str, list[dict[str, Any]]]:
        """A method's policies under every condition, by name and seed."""
        plan = self.plan
        conditions = robustness_conditions()
        names = plan.conditions or tuple(conditions)
        rows: dict[str, list[dict[str, Any]]] = {name: [] for name in names}

        def play(policies: StrokePolicies, seed: int, name: str) -> dict[str, Any]:
            self._progress(f"robustness of {method}, seed {seed}: {name}")
            balls, repertoire = plan.robustness_balls, LearnedStrokes(policies)
            played = self._play(repertoire, balls, ROBUSTNESS_SEED + seed, conditions[name])
            return evaluation_report(played, balls, self.data.landing_points)

        for seed in seeds:
            policies = self._learned.take(method, seed).policies
            folder = self._learned.folder(method, seed)
            for name in names:
                path = folder / f"robust-{plan.robustness_balls}-{file_name(name)}.json"
                rows[name].append(cached(path, partial(play, policies, seed, name)))
        return rows

    def _over_topics(self, live: LivePlan) -> dict[str, Any]:
        """Learning through the nodes beside the same in the batched simulator, and the exchange's curve."""
        subjects = tuple(sorted({episode.subject for episode in self.data.training}))
        settings = [
            asdict(live),
            run_settings(METHODS["msrd"], self.data, self.plan.budget),
            self.plan.robustness_balls,
        ]
        lesson = Lesson(
            self._bags, subjects, self._runs / f"live-{cache_key(settings, self.data.digest)}", TRAINING_SEED
        )

        def play() -> dict[str, Any]:
            rates, balls = {}, self.plan.robustness_balls
            for rollouts in ("batched", "topics"):
                policies = StrokePolicies.load(learn_with_rollouts(lesson, live, rollouts, self._progress))
                played = self._play(LearnedStrokes(policies), balls, EVALUATION_SEED, Conditions())
                rates[rollouts] = evaluation_report(played, balls, self.data.landing_points)["rates"]
            return {"over_topics": rates, "hot_swap": exchange_while_playing(lesson, live, self._progress)}

        return cached(lesson.folder / "played.json", play)

    def _play(self, repertoire: Repertoire, balls: int, seed: int, conditions: Conditions) -> Played:
        world = replace(conditions.world, seed=seed)
        conditions = replace(conditions, world=world)
        fed = evaluation_balls(ALL_LABELS, balls, seed, conditions.spread)
        return play_balls(self._workers, repertoire, fed, conditions)


def run_study(plan: StudyPlan, folder: Path, workers: Workers, progress: Progress) -> dict[str, Any]:
    """Run, or go on with, the study in `folder`; the content of ``metrics.json``."""
    return Study(plan, folder, workers, progress).run()
