"""Recorder node: keeps the strokes that returned the ball as MCAP bags, one bag a stroke."""

from __future__ import annotations

import queue
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_srvs.srv import Trigger

from msrd_ros import __version__
from msrd_ros.bags.devices import ArmMessages
from msrd_ros.bags.metadata import check_subject
from msrd_ros.bags.stroke_buffer import StrokeBuffer
from msrd_ros.bags.strokes import Arrival, CutSettings, Stroke
from msrd_ros.bags.writer import remove_leftovers, set_aside
from msrd_ros.contract.topics import BALL_POSITION, JOINT_STATES, OUTCOME, STRATEGY
from msrd_ros.core.errors import UserError
from msrd_ros.core.parameters import parameter
from msrd_ros.nodes.common import EVENT, robot_parameter, run, status, steady_timer
from msrd_ros.nodes.managed import ManagedNode, autostart_parameter
from msrd_ros.nodes.recorder_inputs import STREAMED, RecorderInputs
from msrd_ros.recordings.limits import InspectionLimits
from msrd_ros.recordings.store import StoreResult, StrokeStore
from msrd_ros.recordings.verdict import Refusal, Verdict
from msrd_ros.robots.loading import load_robot

ADAPT_PERIOD_S = 0.25
SENDERS = {
    JOINT_STATES: "start a simulator or the robot's driver",
    BALL_POSITION: "start a simulator or the camera",
    OUTCOME: "start a simulator or a referee",
}
"""Who is to be started where a topic of a stroke is not heard."""
SETTLE_PERIOD_S = 0.01
MEGABYTE = 1_000_000
VERDICT = "recorder/verdict"
VERDICT_STATUS = "stroke"


@dataclass(frozen=True)
class RecorderConfig:
    """Parameters of the recorder."""

    robot: str = robot_parameter()
    directory: str = parameter("bags", "Folder of the bags; a stroke goes to <subject>/<label>_<nnn>")
    subject: str = parameter(
        "s01",
        "Who shows the strokes: a-z, 0-9 and _; may change between strokes",
        live=True,
        check=check_subject,
    )
    keep: str = parameter(
        "returned",
        "Which strokes are kept: those accepted, or all of them, marked",
        choices=("returned", "all"),
        live=True,
    )
    unlabelled: bool = parameter(
        False,
        "Whether strokes without a label are kept, as unlabelled_<nnn>; else they are refused",
        live=True,
    )
    recording: bool = parameter(
        True, "Whether strokes are recorded; ~/start and ~/stop set it, too", live=True
    )
    note: str = parameter(
        "", "What is said of a stroke in its bag's metadata; may change between strokes", live=True
    )
    pre_roll_s: float = parameter(
        0.2, "What is kept of the time before the launch", unit="s", low=0.0, high=5.0
    )
    longest_s: float = parameter(
        60.0, "A feed without an outcome is given up after so long", unit="s", low=1.0, high=600.0
    )
    speed_tolerance: float = parameter(
        1.01, "Joint speed at any sample that is still accepted, over its limit", low=0.1, high=10.0
    )
    joint_gap_s: float = parameter(
        0.1, "Longest pause of joint_states in a stroke", unit="s", low=0.001, high=10.0
    )
    ball_gap_s: float = parameter(
        0.25, "Longest pause of ball/position in a stroke", unit="s", low=0.001, high=10.0
    )
    minimum_free_mb: float = parameter(
        200.0, "With less room on the disk nothing is kept", unit="MB", low=0.0, high=1e9
    )
    extra_topics: list[str] = parameter(
        [], "Further topics to record: ball/odometry, or NAME=PACKAGE/msg/TYPE for any other"
    )
    autostart: bool = autostart_parameter()


class Recorder(ManagedNode):
    """Buffers what comes in, cuts a stroke per ball, and lets a thread judge and write it."""

    config: RecorderConfig

    def __init__(self) -> None:
        super().__init__("recorder", RecorderConfig)

    def configure(self) -> None:
        """Prepare the folder, and listen; nothing is kept yet."""
        config = self.config
        self._directory = self._prepare_directory()
        robot = load_robot(config.robot)
        self._is_arms = ArmMessages(robot)
        self._store = StrokeStore(
            self._directory,
            robot,
            InspectionLimits(config.speed_tolerance, config.joint_gap_s, config.ball_gap_s),
            f"msrd_ros {__version__}",
            int(config.minimum_free_mb * MEGABYTE),
        )
        self._buffer = StrokeBuffer(CutSettings(config.pre_roll_s, longest_s=config.longest_s), self._is_arms)
        self._discarding = False
        self._kept = 0
        self._last_kept: Path | None = None
        self._rejected: Counter[str] = Counter()
        self._feeds_told = 0
        self._heard: tuple[str, ...] = ()
        self._verdict = self.create_publisher(DiagnosticArray, VERDICT, EVENT)
        self._results: queue.SimpleQueue[StoreResult] = queue.SimpleQueue()
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="bag writer")
        self._held.callback(self._finish)
        self._written = self.create_guard_condition(self._report_results)
        self._settle_timer = steady_timer(self, SETTLE_PERIOD_S, self._settle)
        self._settle_timer.cancel()
        self._inputs = RecorderInputs(self, config.extra_topics, self._take)
        self.on_change(self._change_recording, "recording")
        self.create_service(Trigger, "~/start", self._on_start)
        self.create_service(Trigger, "~/stop", self._on_stop)
        self.create_service(Trigger, "~/discard", self._on_discard)
        steady_timer(self, ADAPT_PERIOD_S, self._adapt)
        state = "recording" if self.config.recording else "waiting for ~/start"
        self.get_logger().info(f"ready: {state}, {self.config.subject} into {self._directory}")

    def deactivate(self) -> None:
        """Write what is decided, and drop the stroke under way."""
        self._cut_all()
        self._buffer.discard()
        # The one thread takes its work in turn.
        self._writer.submit(self._written.trigger).result()
        self._report_results()

    def _finish(self) -> None:
        """Keep what is decided, although the node is told to stop."""
        self._cut_all()
        self._writer.shutdown(wait=True)
        while not self._results.empty():
            self._report(self._results.get(), publish=False)

    def diagnose(self) -> tuple[str, dict[str, object]]:
        """Whether it records, and what it kept and refused."""
        return "recording" if self.config.recording else "stopped", {
            "subject": self.config.subject,
            "kept": self._kept,
            "rejected": self._rejected.total(),
            **{f"rejected_{reason}": count for reason, count in sorted(self._rejected.items())},
            "messages_lost": self._inputs.lost,
            "passed_over": self._is_arms.passed_over,
            "disk_left_mb": self._store.free_bytes // MEGABYTE,
            "stroke_under_way": self._buffer.under_way,
            "decided": self._buffer.pending,
            "hears": " ".join(self._heard),
        }

    def waits_for(self) -> list[str]:
        """What is missing until strokes can be kept."""
        missing = [f"{role}: {sender}" for role, sender in SENDERS.items() if role not in self._heard]
        if not self.config.recording:
            missing.append("leave to record: call ~/start, or set parameter recording")
        if self._store.free_bytes < self.config.minimum_free_mb * MEGABYTE:
            missing.append("room on the disk: make some, or see parameter minimum_free_mb")
        return missing

    @property
    def _records(self) -> bool:
        """Whether strokes are to be kept."""
        return self.active and self.config.recording

    # -- setting up ----------------------------------------------------------------------------

    def _prepare_directory(self) -> Path:
        directory = Path(self.config.directory).expanduser().absolute()
        try:
            directory.mkdir(parents=True, exist_ok=True)
            probe = directory / ".writable"
            probe.touch()
            probe.unlink()
        except OSError as error:
            raise UserError(
                f"parameter directory of recorder: {directory} cannot be written ({error.strerror}); "
                f"give another folder"
            ) from None
        removed = remove_leftovers(directory)
        if removed:
            self.get_logger().warning(f"removed {removed} strokes that a recorder had not finished writing")
        return directory

    # -- what comes in -------------------------------------------------------------------------

    def _take(self, arrival: Arrival) -> None:
        if self._records or arrival.role in (STRATEGY, OUTCOME):
            self._buffer.add(arrival)
        if arrival.role == OUTCOME:
            self._settle_timer.reset()

    def _adapt(self) -> None:
        self._inputs.adapt()
        if self._inputs.heard != self._heard:
            self._heard = self._inputs.heard
            silent = [role for role in STREAMED if role not in self._heard]
            silence = f"; nobody publishes {', '.join(silent)}" if silent else ""
            self.get_logger().info(f"hears {', '.join(self._heard) or 'nothing'}{silence}")
        for line in self._is_arms.news():
            self.get_logger().warning(line)
        if self._buffer.expired_feeds > self._feeds_told:
            self._feeds_told = self._buffer.expired_feeds
            self.get_logger().warning(
                f"no rally/outcome came within {self.config.longest_s:g} s after a feed; "
                f"start a simulator or a referee on this domain"
            )

    # -- strokes -------------------------------------------------------------------------------

    def _settle(self) -> None:
        self._buffer.tick()
        while self._buffer.settled():
            self._cut()
        if not self._buffer.pending:
            self._settle_timer.cancel()

    def _cut_all(self) -> None:
        """Cut all that is decided, settled or not."""
        while self._buffer.pending:
            self._cut()

    def _cut(self) -> None:
        stroke = self._buffer.cut()
        refusal = None
        if not self._records:
            reason = "stopped; call ~/start" if self.active else "inactive; activate it (ros2 lifecycle)"
            refusal = Verdict(Refusal.STOPPED, f"the recorder is {reason}")
        elif self._discarding:
            refusal = Verdict(Refusal.DISCARDED, "dropped by ~/discard")
        self._discarding = False
        if refusal is not None:
            self._results.put(StoreResult(stroke, self.config.subject, refusal))
            self._written.trigger()
            return
        topics, latched = dict(self._inputs.topics), dict(self._inputs.latched)
        config = self.config
        self._writer.submit(
            self._keep,
            stroke,
            config.subject,
            topics,
            latched,
            config.keep == "all",
            config.note,
            config.unlabelled,
        )

    def _keep(self, stroke: Stroke, subject: str, *details: Any) -> None:
        """Judge and write, on the writer's thread; the node's own thread then reports."""
        try:
            result = self._store.keep(stroke, subject, *details)
        except Exception as error:  # one stroke that cannot be handled must not end the session
            result = StoreResult(stroke, subject, Verdict(Refusal.WRITE_FAILED, repr(error)))
        self._results.put(result)
        self._written.trigger()

    def _report_results(self) -> None:
        while not self._results.empty():
            self._report(self._results.get(), publish=True)

    def _report(self, result: StoreResult, publish: bool) -> None:
        verdict = result.verdict
        logger = self.get_logger()
        if verdict.accepted:
            self._kept += 1
            self._last_kept = result.path
            notes = "".join(f"; {note}" for note in verdict.notes)
            logger.info(f"kept {result.name}: {result.path}{notes}")
        else:
            self._rejected[verdict.reason] += 1
            stored = f"; stored all the same: {result.path}" if result.path else ""
            line = f"not kept: {result.name}: {verdict.reason}, {verdict.detail}{stored}"
            if verdict.reason in (Refusal.DISK_FULL, Refusal.WRITE_FAILED):
                logger.error(line)
            else:
                logger.info(line)
        if publish:
            self._publish_verdict(result)

    def _publish_verdict(self, result: StoreResult) -> None:
        verdict = result.verdict
        values = {
            "ball_id": result.stroke.ball_id,
            "kept": verdict.accepted,
            "reason": verdict.reason,
            "path": str(result.path or ""),
            "subject": result.subject,
            "detail": verdict.detail,
        }
        level = DiagnosticStatus.OK if verdict.accepted else DiagnosticStatus.WARN
        array = DiagnosticArray(
            status=[status(VERDICT_STATUS, "kept" if verdict.accepted else verdict.reason, values, level)]
        )
        array.header.stamp = self.get_clock().now().to_msg()
        array.header.frame_id = str(result.stroke.label or "")
        self._verdict.publish(array)

    # -- what the user changes -----------------------------------------------------------------

    def _change_recording(self) -> None:
        if not self.config.recording:
            self._buffer.discard()

    def _on_start(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.refuses(response):
            return response
        self.change("recording", True)
        response.success, response.message = True, f"recording {self.config.subject} into {self._directory}"
        return response

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        dropped = self._buffer.under_way
        self.change("recording", False)
        response.success = True
        response.message = "stopped" + ("; dropped the stroke under way" if dropped else "")
        return response

    def _on_discard(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._buffer.under_way:
            self._buffer.discard()
            self._discarding = True
            response.success, response.message = True, "dropped the stroke under way"
        elif self._last_kept is not None and self._last_kept.is_dir():
            try:
                target = set_aside(self._directory, self._last_kept)
            except OSError as error:
                response.success = False
                response.message = f"{self._last_kept} cannot be moved aside ({error}); move it by hand"
                return response
            response.success, response.message = True, f"moved {self._last_kept} to {target}"
            self._kept -= 1
            self._rejected[Refusal.DISCARDED] += 1
            self._last_kept = None
        else:
            response.success, response.message = False, "no stroke is under way, and none was kept before"
        self.get_logger().info(f"discard: {response.message}")
        return response


def main(argv: list[str] | None = None) -> int:
    """Start the recorder."""
    return run("recorder", Recorder, argv, __doc__)
