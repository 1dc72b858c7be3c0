"""Studio node: a page in the browser to watch and drive the stack with."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np
from rclpy.guard_condition import GuardCondition

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.core.parameters import parameter
from msrd_ros.explain.figure import MOST_STROKES
from msrd_ros.nodes.common import SIDE_OF, StackNode, robot_parameter, run, steady_timer
from msrd_ros.nodes.given_files import given_files
from msrd_ros.robots.loading import load_robot
from msrd_ros.studio.control import FASTEST, SLOWEST, Answer, Control
from msrd_ros.studio.gateway import Browser, Gateway, address
from msrd_ros.studio.ghosts import Ghosts
from msrd_ros.studio.guard import LOOPBACK, Guard
from msrd_ros.studio.keeping import Keeping
from msrd_ros.studio.laid_paths import COLOURS, coloured_by_reward, compared
from msrd_ros.studio.leading import Leading
from msrd_ros.studio.learn import Learn, LearnConfig
from msrd_ros.studio.library import VERBS, Library
from msrd_ros.studio.replay import Replay
from msrd_ros.studio.requests import Request
from msrd_ros.studio.scene import TableScene
from msrd_ros.studio.sketching import Sketching
from msrd_ros.studio.teaching import Teaching
from msrd_ros.studio.understanding import Understanding
from msrd_ros.studio.watch import Watch
from msrd_ros.table_tennis.strategies.table import STRATEGIES_HELP, Side, Strategies

STATE_PERIOD_S = 0.1
TEACH_STREAM = 0x7EAC
FEED_AGAIN_S = 8.0
"""A ball of which nothing has been heard for so long is followed by the next."""


@dataclass(frozen=True)
class StudioConfig:
    """Parameters of the studio."""

    robot: str = robot_parameter()
    mode: str = parameter(
        "lockstep",
        "lockstep answers the ticks of a simulator that waits for them; real_time goes by the clock",
        choices=("lockstep", "real_time"),
    )
    port: int = parameter(8080, "Where the page is: http://127.0.0.1:PORT", low=1, high=65535)
    expose: bool = parameter(
        False,
        "Listen to other machines, too; whoever knows the token drives the arm, and nothing is encrypted",
    )
    token: str = parameter(
        "", "What a browser must know to come in; with expose one is made up where none is given"
    )
    bags: str = parameter("bags", "Folder of the bags that can be looked at and edited")
    run: str = parameter("out/demo/training", "Folder of the training run whose rewards explain strokes")
    runs: str = parameter("runs", "Folder of the training runs that are started from the page")
    strategies: str = parameter("", STRATEGIES_HELP)
    seed: int = parameter(0, "Seed of the feeds", low=0)
    frames_hz: float = parameter(30.0, "How often the picture changes", unit="Hz", low=1.0, high=60.0)


class Studio(StackNode):
    """Shows what the topics tell, and sends what a page asks for.

    Browsers are served on other threads; what they ask for is done on the node's own.
    """

    config: StudioConfig

    def __init__(self) -> None:
        super().__init__("studio", StudioConfig)
        config = self.config
        self._robot = load_robot(config.robot)
        self._strategies = Strategies.load(config.strategies)
        self._watch = Watch(self, self._robot)
        self._control = Control(self, self._strategies, np.random.default_rng(config.seed))
        self._library = Library(Path(config.bags), self._robot)
        self._understanding = Understanding(Path(config.run), self._robot, self._strategies)
        lockstep = config.mode == "lockstep"
        self._leading = Leading(self, self._robot, self._watch, self._control, lockstep)
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="library")
        files = tuple(given_files(self.command_line))
        learning = LearnConfig(config.robot, config.strategies, Path(config.runs), files)
        self._learn = Learn(self, learning, self._library, self._robot, self._later)
        self._replay: Replay | None = None
        self._feeds_on = False
        self._fed_s, self._fed_at = 0.0, -1
        self._asked: SimpleQueue[tuple[Browser, dict[str, Any]]] = SimpleQueue()
        self._rung: GuardCondition = self.create_guard_condition(self._answer_all)
        self._verbs: dict[str, Callable[[Request, Answer], None]] = {
            "strategy": self._do_strategy,
            "feed": self._do_feed,
            "feed_on": self._do_feed_on,
            "stop": self._do_stop,
            "enable": lambda _, answer: self._control.enable(True, answer),
            "pause": lambda request, answer: self._control.pause(request.flag("on"), answer),
            "step": lambda _, answer: self._control.step(answer),
            "reset": lambda _, answer: self._control.reset(answer),
            "rate": self._do_rate,
            "forget_rates": self._do_forget_rates,
            "library": self._do_library,
            **dict.fromkeys(VERBS, self._do_edit),
            "compare": self._do_compare,
            "explain": self._do_explain,
            "replay": self._do_replay,
            "seek": self._do_seek,
            **self._learn.verbs,
        }
        token = config.token or (secrets.token_urlsafe(16) if config.expose else "")
        guard, host = Guard(config.port, token), "0.0.0.0" if config.expose else LOOPBACK
        self._scene = TableScene(self._robot)
        self._teaching = Teaching(
            self._robot,
            self._leading,
            Sketching(self._robot, Ghosts(self._scene.viser)),
            Keeping(self._library),
            self._later,
            np.random.default_rng((TEACH_STREAM, config.seed)),
        )
        self._verbs.update(self._teaching.verbs)
        try:
            self._gateway = Gateway(guard, host, self._scene.viser, self._ask, self._left)
        except UserError:
            self._scene.close()
            raise
        self._shown_s = time.monotonic()
        steady_timer(self, 1.0 / config.frames_hz, self._show)
        steady_timer(self, STATE_PERIOD_S, self._tell)
        if config.expose:
            self.get_logger().warning(
                "exposed: who reaches this machine and knows the token drives the arm; nothing is encrypted"
            )
        print(f"studio: open {address(host, guard)}", flush=True)

    def close(self) -> None:
        """Serve no more."""
        self._gateway.close()
        self._learn.close()
        self._worker.shutdown(cancel_futures=True)
        self._scene.close()

    def diagnose(self) -> tuple[str, dict[str, object]]:
        """Who looks on."""
        return "serving", {"browsers": self._gateway.browsers, "replay": self._replay is not None}

    # -- what is shown -------------------------------------------------------------------------

    def _show(self) -> None:
        now_s = time.monotonic()
        period_s, self._shown_s = now_s - self._shown_s, now_s
        if not self._gateway.browsers:
            return
        live = self._watch.picture()
        if self._replay is not None:
            self._replay.advance(period_s)
            live = self._replay.picture()
        self._scene.show(live)

    def _tell(self) -> None:
        self._feed_again()
        if not self._gateway.browsers:
            return
        simulator, executor = self._watch.values("simulator"), self._watch.values("executor")
        state = self._watch.state()
        playable = self._playable()
        known = list(dict.fromkeys([*map(str, self._strategies.labels), *playable]))
        self._gateway.show(
            {
                **state,
                "robot": self._robot.name,
                "strategies": known,
                "playable": list(playable),
                "learning": self._learn.state(),
                "colours": {name: self._strategies.of(StrategyLabel(name)).colour for name in known},
                "simulated": bool(simulator),
                "paused": simulator.get("paused") == "true",
                "rate": float(simulator.get("rate", "0")),
                "enabled": executor.get("enabled") == "true",
                "driven": bool(executor),
                "feeds_on": self._feeds_on,
                "replay": self._replay.state() if self._replay else None,
                "teach": self._teaching.told(),
            }
        )

    def _feed_again(self) -> None:
        """Feed on and on: the next ball once the last is decided."""
        if not self._feeds_on:
            return
        decided = self._watch.decided != self._fed_at
        if not decided and time.monotonic() - self._fed_s < FEED_AGAIN_S:
            return
        try:
            self._feed_one()
        except UserError as error:
            self._feeds_on = False
            self.complain(error)

    def _feed_one(self) -> str:
        if self._watch.values("executor").get("enabled") == "false":
            raise UserError("the arm is stopped and would miss it; let it move first")
        self._fed_s, self._fed_at = time.monotonic(), self._watch.decided
        return self._control.feed(self._playable().get(str(self._control.wanted)))

    def _playable(self) -> dict[str, Side]:
        """What the executor has policies for, and where each stands."""
        return {
            key.removeprefix(SIDE_OF): Side(side)
            for key, side in self._watch.values("executor").items()
            if key.startswith(SIDE_OF) and side in tuple(Side)
        }

    # -- what is asked for ---------------------------------------------------------------------

    def _ask(self, browser: Browser, content: dict[str, Any]) -> None:
        """Note what a browser wants; called on the server's thread."""
        self._asked.put((browser, content))
        self._rung.trigger()

    def _left(self, browser: Browser) -> None:
        """A browser is gone; called on the server's thread."""
        self._ask(browser, {"do": "leave"})

    def _answer_all(self) -> None:
        while not self._asked.empty():
            self._do(*self._asked.get())

    def _do(self, browser: Browser, content: dict[str, Any]) -> None:
        request = Request(content, browser.number)

        def answer(ok: bool, text: str, **values: object) -> None:
            browser.answer(
                {"type": "answer", "id": request.number, "do": request.verb, "ok": ok, "text": text, **values}
            )

        verb = self._verbs.get(request.verb)
        if verb is None:
            answer(False, f"{request.verb!r} is unknown; use one of {', '.join(self._verbs)}")
            return
        try:
            verb(request, answer)
        except UserError as error:
            answer(False, str(error))

    def _do_strategy(self, request: Request, answer: Answer) -> None:
        text = request.text("name")
        self._control.choose(StrategyLabel.parse(text, "strategy") if text else None)
        answer(True, f"{text} from the next ball on" if text else "no strategy: the arm stays where it rests")

    def _do_feed(self, request: Request, answer: Answer) -> None:
        text = self._control.set_feed(request)
        answer(True, f"{self._feed_one()}; {text}")

    def _do_feed_on(self, request: Request, answer: Answer) -> None:
        wanted = request.flag("on")
        if wanted:
            self._control.set_feed(request)
            self._feed_one()
        self._feeds_on = wanted
        answer(True, "balls follow one another" if wanted else "no more balls")

    def _do_stop(self, _: Request, answer: Answer) -> None:
        self._feeds_on = False
        self._leading.halt()
        self._control.enable(False, answer)

    def _do_rate(self, request: Request, answer: Answer) -> None:
        rate = request.within("rate", 0.0, FASTEST)
        if 0.0 < rate < SLOWEST:
            raise UserError(f"rate: {rate:g} is too slow to watch; give {SLOWEST:g} to {FASTEST:g}, or 0")
        self._control.set_rate(rate, answer)

    def _do_forget_rates(self, _: Request, answer: Answer) -> None:
        self._watch.forget_rates()
        answer(True, "counted anew")

    # -- recorded strokes ----------------------------------------------------------------------

    def _later(self, answer: Answer, work: Callable[[], tuple[str, dict[str, Any]]]) -> None:
        """Do what takes its time on a thread of its own, one thing after the other, and answer then."""

        def run() -> None:
            try:
                text, values = work()
            except UserError as error:
                answer(False, str(error))
            else:
                answer(True, text, **values)

        self._worker.submit(run)

    def _do_library(self, request: Request, answer: Answer) -> None:
        discarded = request.flag("discarded")

        def work() -> tuple[str, dict[str, Any]]:
            found = self._library.strokes(discarded)
            return f"{len(found['rows'])} strokes in {self._library.folder.absolute()}", found

        self._later(answer, work)

    def _do_edit(self, request: Request, answer: Answer) -> None:
        self._later(answer, lambda: (self._library.edit(request), {}))

    def _do_replay(self, request: Request, answer: Answer) -> None:
        name = request.text("bag")
        if not name:
            self._replay = None
            self._scene.lay_over([])
            answer(True, "live")
            return

        def work() -> tuple[str, dict[str, Any]]:
            self._replay = replay = Replay(self._library.episode(name), name)
            return f"{name}: {replay.length_s:.2f} s", {}

        self._later(answer, work)

    def _do_seek(self, request: Request, answer: Answer) -> None:
        if self._replay is None:
            raise UserError("seek: no stroke is shown; choose one first")
        if request.flag("runs"):
            self._replay.runs = True
        else:
            self._replay.seek(request.within("time", 0.0, 1000.0, "s"))
        answer(True, "")

    def _do_compare(self, request: Request, answer: Answer) -> None:
        names = request.texts("bags", most=len(COLOURS))

        def work() -> tuple[str, dict[str, Any]]:
            self._scene.lay_over(compared(self._library.episodes(names)))
            return f"{len(names)} strokes laid over each other", {"colours": COLOURS[: len(names)]}

        self._later(answer, work)

    def _do_explain(self, request: Request, answer: Answer) -> None:
        names = request.texts("bags", most=MOST_STROKES)

        def work() -> tuple[str, dict[str, Any]]:
            episodes = self._library.episodes(names)
            told = self._understanding.explain(episodes)
            self._replay = Replay(episodes[0], names[0])
            self._scene.lay_over([coloured_by_reward(told[0])])
            return "yellow where R0 is highest, violet where it is lowest", self._understanding.picture(told)

        self._later(answer, work)


def main(argv: list[str] | None = None) -> int:
    """Start the studio."""
    return run("studio", Studio, argv, __doc__)
