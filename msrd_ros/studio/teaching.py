"""Teaching by hand: what a page may ask for, and which strokes came of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.led_stroke import Led
from msrd_ros.robots.robot import Robot
from msrd_ros.studio.control import Answer
from msrd_ros.studio.guiding import DraggedStroke, guide_view
from msrd_ros.studio.keeping import Keeping
from msrd_ros.studio.leading import Leading
from msrd_ros.studio.requests import Request
from msrd_ros.studio.series import Series
from msrd_ros.studio.sketching import Sketching
from msrd_ros.studio.task import FULL_SPEED, Task
from msrd_ros.studio.views import sketch_view
from msrd_ros.table_tennis.ball.feeder import SPREADS
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.teachers.sketch_plan import SketchPlan
from msrd_ros.table_tennis.teachers.sketched_stroke import SketchedStroke

Verb = Callable[[Request, Answer], None]
Later = Callable[[Answer, Callable[[], tuple[str, dict[str, Any]]]], None]
"""Does what takes its time elsewhere, and answers then."""

MOST_VARIATIONS = 50
SLOWEST, FASTEST = 0.05, 0.5
"""Rates at which a person guides."""
_ALONG_M, _UP_M = 1.5, 1.0


class Teaching:
    """Sketch, guide, vary, keep.

    Parameters
    ----------
    robot
        The arm that is led.
    leading
        Leads it.
    sketching
        What is drawn.
    keeping
        What becomes of the strokes.
    later
        Does what takes its time.
    rng
        Draws variations and their feeds.

    Attributes
    ----------
    verbs
        What a page may ask for, by name.
    """

    def __init__(
        self,
        robot: Robot,
        leading: Leading,
        sketching: Sketching,
        keeping: Keeping,
        later: Later,
        rng: np.random.Generator,
    ) -> None:
        self._robot, self._leading, self._sketching, self._keeping = robot, leading, sketching, keeping
        self._later, self._rng = later, rng
        self._guided: DraggedStroke | None = None
        self._series: Series | None = None
        self._drawn_plan: SketchPlan | None = None
        self._drawn_told: dict[str, Any] = {"sketch": None, "guide": None}
        self.verbs: dict[str, Verb] = {
            "teach_begin": self._do_begin,
            "teach_move": self._drawn(sketching.move),
            "teach_time": self._drawn(sketching.time),
            "teach_hide": self._do_hide,
            "teach_lead": self._begun(self._lead),
            "teach_guide": self._begun(self._guide),
            "teach_vary": self._begun(self._vary),
            "teach_drag": self._do_drag,
            "teach_release": self._do_release,
            "teach_keep": lambda _, answer: answer(True, keeping.keep()),
            "teach_discard": lambda _, answer: later(answer, lambda: (keeping.discard(), {})),
            "teach_label": lambda request, answer: later(
                answer, lambda: (keeping.label(request.text("label")), {})
            ),
            "teach_stop": self._do_stop,
            "teach_enable": self._do_enable,
            "leave": lambda request, _: self.forget(request.browser),
        }

    def told(self) -> dict[str, Any]:
        """How it stands, for the page."""
        leading, guided = self._leading, self._guided
        return {
            "leader": leading.leader,
            "turn": leading.told,
            "leads": leading.leads,
            "real": not leading.is_simulated,
            "trouble": leading.trouble,
            **self._drawing(),
            "guided": guided.told() if guided is not None else None,
            "series": self._series.told() if self._series is not None else None,
            "strokes": self._keeping.told(),
        }

    def _drawing(self) -> dict[str, Any]:
        """The sketch and the plane that it is guided in, worked out once a plan; it is told all the time."""
        plan = self._sketching.plan
        if plan is not None and plan is not self._drawn_plan:
            self._drawn_plan = plan
            self._drawn_told = {"sketch": sketch_view(plan), "guide": guide_view(self._robot, plan)}
        return self._drawn_told

    def forget(self, browser: int) -> None:
        """A browser is gone; what it held it lets go of."""
        if self._guided is not None and self._leading.leader == browser:
            self._guided.release()
        self._leading.forget(browser)

    # -- the sketch ----------------------------------------------------------------------------

    def _do_begin(self, request: Request, answer: Answer) -> None:
        self._leading.require_free(request.browser)
        label = StrategyLabel.parse(request.text("name"), "strategy")
        side = Side(request.choice("side", tuple(Side)))
        self._later(answer, lambda: (self._sketching.begin(label, side), {}))

    def _drawn(self, change: Callable[[Request], None]) -> Verb:
        """What changes the sketch, while nobody leads it."""

        def verb(request: Request, _: Answer) -> None:
            self._leading.require_free(request.browser)
            change(request)

        return verb

    def _do_hide(self, _: Request, answer: Answer) -> None:
        self._sketching.hide()
        answer(True, "")

    # -- leading -------------------------------------------------------------------------------

    def _begun(self, begin: Callable[[Request], str]) -> Verb:
        """What leads strokes of the sketch under the name that the page says."""

        def verb(request: Request, answer: Answer) -> None:
            self._leading.require_free(request.browser)
            label = StrategyLabel.parse(request.text("name"), "strategy")
            if label != self._sketching.sketch.strategy:
                self._sketching.rename(label)
            answer(True, begin(request))

        return verb

    def _lead(self, request: Request) -> str:
        plan = self._sketching.require_plan()
        stroke = SketchedStroke(self._robot, plan)
        self._guided = self._series = None
        task = Task(plan.sketch.strategy, stroke, plan.sketch.feed, True, "sketched", FULL_SPEED)
        self._leading.lead(request.browser, task, self._one_done)
        return "the arm gets ready; then the sketch is led at full speed"

    def _guide(self, request: Request) -> str:
        rate = request.within("rate", SLOWEST, FASTEST)
        plan = self._sketching.require_plan()
        stroke = DraggedStroke(self._robot, plan)
        task = Task(plan.sketch.strategy, stroke, plan.sketch.feed, False, "guided", rate)
        self._leading.lead(request.browser, task, self._one_done)
        self._guided, self._series = stroke, None
        return "the arm gets ready; the ball comes as soon as you take the paddle"

    def _vary(self, request: Request) -> str:
        count = int(request.within("count", 1, MOST_VARIATIONS))
        spread = request.choice("spread", tuple(SPREADS))
        plan = self._sketching.require_plan()
        series = Series(self._robot, plan.sketch, self._keeping.base, count, spread, self._rng)
        task = series.next()
        self._leading.lead(request.browser, task, self._one_of_series_done)
        self._guided, self._series = None, series
        return f"{count} variations of {plan.sketch.strategy} are recorded"

    def _one_done(self, task: Task, led: Led) -> None:
        self._keeping.add(task, led)
        self._guided = None

    def _one_of_series_done(self, task: Task, led: Led) -> Task | None:
        assert self._series is not None
        self._keeping.add(task, led)
        self._series.add(led)
        try:
            return None if self._series.is_over else self._series.next()
        except UserError as error:
            self._leading.trouble = str(error)
            return None

    def _do_drag(self, request: Request, _: Answer) -> None:
        place = request.within("along", -_ALONG_M, _ALONG_M, "m"), request.within("up", -_UP_M, _UP_M, "m")
        if self._guided is None or not self._leading.leads:
            return  # not yet, or not any more
        if self._leading.leader != request.browser:
            raise UserError("somebody else has the paddle in hand; wait until that stroke is over")
        self._guided.drag(*place)
        self._leading.launch()

    def _do_release(self, request: Request, _: Answer) -> None:
        if self._guided is not None and self._leading.leader == request.browser:
            self._guided.release()

    def _do_stop(self, _: Request, answer: Answer) -> None:
        self._leading.stop("the hand has let go")
        answer(True, "the hand lets go; the arm comes to rest")

    def _do_enable(self, request: Request, answer: Answer) -> None:
        self._leading.arm(request.browser)
        answer(True, "this page may lead the arm now; keep your hand at the stop")
