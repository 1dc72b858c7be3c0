"""Player node: replays bags onto the topics with their own timing, at any rate whose messages all arrive."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header

from msrd_ros.bags.info import BagInfo
from msrd_ros.bags.reader import Bag
from msrd_ros.contract.labels import UNLABELLED, read_label
from msrd_ros.contract.topics import (
    BALL_POSITION,
    CONTRACT,
    JOINT_STATES,
    STRATEGY,
    TF_STATIC,
    BagMessage,
    parse_topic_names,
)
from msrd_ros.contract.translation import ns_to_stamp
from msrd_ros.core.errors import UserError
from msrd_ros.core.parameters import parameter
from msrd_ros.core.resources import shipped_bags
from msrd_ros.nodes.common import COMMAND, Finished, StackNode, run, steady_timer
from msrd_ros.nodes.recorder_inputs import LATCHED, MOST_LATCHED, STREAMED, import_message_type
from msrd_ros.nodes.speakers import LiveArm
from msrd_ros.recordings.library import BagLibrary

TICK_S = 0.001
BURST = 50
"""Messages that may go out at once after a pause, without waiting for the pace."""
ACKNOWLEDGE_S = 0.05
PATIENCE_S = 5.0
"""How long to wait at the end: Fast DDS asks its readers what they have every 3 s."""
GRACE_S = 2.0
"""How long to wait for the less important subscribers once there are some for joints and ball: without feed
and outcome a trainer makes nothing of a stroke, and a starved machine discovers topics one by one."""
CLOCK_PERIOD_NS = 5_000_000


class State(StrEnum):
    """What the player does at the moment."""

    WAITING = "waiting for subscribers"
    PLAYING = "playing"
    ENDING = "waiting until all has arrived"


@dataclass(frozen=True)
class PlayerConfig:
    """Parameters of the player."""

    bags: list[str] = parameter(
        [], "Bags or folders of bags to play; the recorded set of the package if empty"
    )
    labels: list[str] = parameter(
        [], f"Strategies to play, {UNLABELLED} for strokes without a label; all if empty"
    )
    subjects: list[str] = parameter([], "Subjects to play; all if empty")
    kept_only: bool = parameter(True, "Leave out strokes that the recorder had refused")
    topics: list[str] = parameter([], "What topics are called in the bags, as NAME:=NAME_IN_BAG")
    rate: float = parameter(
        1.0,
        "Speed of playback; 0 plays as fast as max_messages_per_s allows",
        low=0.0,
        high=1000.0,
        live=True,
    )
    max_messages_per_s: float = parameter(
        3000.0,
        "Never send faster, so that all messages arrive",
        unit="1/s",
        low=1.0,
        high=100_000.0,
        live=True,
    )
    loop: bool = parameter(False, "Begin again at the end", live=True)
    clock: bool = parameter(True, "Publish clock")
    wait_s: float = parameter(
        10.0,
        "How long to wait for subscribers of joint_states and ball/position",
        unit="s",
        low=0.0,
        high=3600.0,
    )
    start_delay_s: float = parameter(
        0.5, "Pause between the first subscribers and the first message", unit="s", low=0.0, high=60.0
    )


class Player(StackNode):
    """Plays one bag after the other."""

    config: PlayerConfig

    def __init__(self) -> None:
        super().__init__("player", PlayerConfig)
        self._names = parse_topic_names(self.config.topics, "parameter topics of player")
        self._bags = self._select_bags()
        self._waiting_bags: deque[BagInfo] = deque(self._bags)
        self._messages: deque[BagMessage] = deque()
        self._outputs: dict[str, Publisher | None] = {}
        self._last_sent: dict[str, bytes] = {}
        self._clock_output = self.create_publisher(Clock, "clock", COMMAND) if self.config.clock else None
        self._clock_log_ns = -CLOCK_PERIOD_NS
        self._bag_log_ns = 0
        self._bag_begin_s = 0.0
        self._budget = 0.0
        self._ticked_s = time.monotonic()
        self._since_s = time.monotonic()
        self._heard_s = 0.0
        self._first_sent_s = 0.0
        self._played_bags = 0
        self._failed_bags = 0
        self._sent = 0
        self._state = State.WAITING
        self._live_arm = LiveArm(self)
        for role in (*LATCHED, *STREAMED):
            self._publisher(role, CONTRACT[role].type_name)
        self.on_change(self._count_time_anew, "rate")
        self.get_logger().info(f"ready: {len(self._bags)} bags, {self._state}")
        steady_timer(self, TICK_S, self._tick)

    def diagnose(self) -> tuple[str, dict[str, object]]:
        """How far playing is."""
        return str(self._state), {
            "bags": len(self._bags),
            "played": self._played_bags,
            "refused": self._failed_bags,
            "messages": self._sent,
        }

    def waits_for(self) -> list[str]:
        """Who would have to listen for playing to begin."""
        if self._state != State.WAITING:
            return []
        lonely = [role for role in (JOINT_STATES, BALL_POSITION) if not self._subscribers(role)]
        return [f"subscribers of {role}: start a trainer or a recorder" for role in lonely]

    # -- bags ----------------------------------------------------------------------------------

    def _select_bags(self) -> Sequence[BagInfo]:
        labels = [read_label(text, "parameter labels of player") for text in self.config.labels]
        library = BagLibrary.scan(*(self.config.bags or [str(shipped_bags())]))
        for line in library.refused:
            self.get_logger().warning(f"left out: {line}")
        return library.select(labels, self.config.subjects, self.config.kept_only)

    def _open_next_bag(self) -> bool:
        """Read the next sound bag; False if there is none."""
        while self._waiting_bags or (self.config.loop and self._played_bags):
            if not self._waiting_bags:
                self._waiting_bags.extend(self._bags)
            info = self._waiting_bags.popleft()
            try:
                bag = Bag(info.path, self._names)
                self._messages = deque(self._prepare(bag))
            except UserError as error:
                self._failed_bags += 1
                self.get_logger().error(f"left out: {error}")
                continue
            self._played_bags += 1
            self._count_time_anew()
            self._clock_log_ns = -CLOCK_PERIOD_NS
            self.get_logger().info(f"playing bag {self._played_bags} of {len(self._bags)}: {info.path}")
            return True
        return False

    def _count_time_anew(self) -> None:
        """Let the next message be due now, and those behind it in their time at the present rate."""
        if self._messages:
            self._bag_log_ns = self._messages[0].log_time_ns
            self._bag_begin_s = time.monotonic()

    def _prepare(self, bag: Bag) -> list[BagMessage]:
        """The bag's messages on relative names; publishers for all of them."""
        raw = bag.raw()
        labels = bag.labels(raw)
        messages = [message._replace(topic=bag.role(message.topic)) for message in raw]
        if len(labels) < 2 and not any(message.topic == STRATEGY for message in messages):
            # The label that a foreign bag's name or metadata tells of travels in a header, as from a person.
            # None travels as well: else the strategy of the bag before would still be in effect.
            first_ns = messages[0].log_time_ns
            header = Header(stamp=_stamp(first_ns), frame_id=next(iter(labels), ""))
            messages.insert(0, BagMessage(STRATEGY, serialize_message(header), first_ns, first_ns))
        types = {bag.role(name): type_name for name, type_name in bag.info.types.items()}
        for topic in dict.fromkeys(message.topic for message in messages):
            facts = CONTRACT.get(topic)
            self._publisher(topic, types.get(topic) or (facts.type_name if facts else "unknown"))
        return [message for message in messages if self._outputs[message.topic] is not None]

    def _publisher(self, topic: str, type_name: str) -> None:
        if topic in self._outputs:
            return
        facts = CONTRACT.get(topic)
        depth = facts.depth if facts else CONTRACT[JOINT_STATES].depth
        latched = facts is not None and facts.latched
        profile = QoSProfile(
            depth=MOST_LATCHED if topic == TF_STATIC else depth,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )
        self._outputs[topic] = None
        try:
            message_type = import_message_type(type_name)
            self._outputs[topic] = self.create_publisher(message_type, topic, profile)
        except Exception as error:  # a name or type from elsewhere that the middleware does not take
            reason = (str(error).splitlines() or [repr(error)])[0]
            self.get_logger().warning(f"topic {topic} is not played: {reason}")

    # -- playing -------------------------------------------------------------------------------

    def _tick(self) -> None:
        now_s = time.monotonic()
        if self._state == State.WAITING:
            self._wait_for_subscribers(now_s)
        elif self._state == State.PLAYING:
            self._play(now_s)
        else:
            self._end(now_s)
        self._ticked_s = now_s

    def _wait_for_subscribers(self, now_s: float) -> None:
        self._live_arm.refuse()
        waited_s = now_s - self._since_s
        missing = [role for role in STREAMED if not self._subscribers(role)]
        needed = [role for role in missing if role in (JOINT_STATES, BALL_POSITION)]
        if needed and waited_s < self.config.wait_s:
            return
        if needed:
            self.get_logger().warning(
                f"nobody subscribes to {' and '.join(needed)} on this domain; playing all the same"
            )
        else:
            self._heard_s = self._heard_s or now_s
            if missing and now_s - self._heard_s < GRACE_S:
                return
        if self._first_sent_s == 0.0:
            self._first_sent_s = now_s + (0.0 if needed else self.config.start_delay_s)
        if now_s >= self._first_sent_s:
            self._live_arm.close()
            self._state = State.PLAYING

    def _play(self, now_s: float) -> None:
        pace = self.config.max_messages_per_s
        self._budget = min(self._budget + (now_s - self._ticked_s) * pace, BURST)
        while self._budget >= 1.0:
            if not self._messages and not self._open_next_bag():
                if not self._played_bags:
                    raise UserError("no bag could be played; see the lines above")
                self._state, self._since_s = State.ENDING, now_s
                return
            message = self._messages[0]
            if self.config.rate > 0.0:
                ahead_s = (message.log_time_ns - self._bag_log_ns) / 1e9 / self.config.rate
                if self._bag_begin_s + ahead_s > time.monotonic():
                    return
            self._messages.popleft()
            self._send(message)

    def _send(self, message: BagMessage) -> None:
        publisher = self._outputs[message.topic]
        assert publisher is not None
        if message.topic in LATCHED and self._last_sent.get(message.topic) == message.data:
            return
        if self._clock_output is not None and message.log_time_ns >= self._clock_log_ns + CLOCK_PERIOD_NS:
            self._clock_log_ns = message.log_time_ns
            self._clock_output.publish(Clock(clock=_stamp(message.log_time_ns)))
            self._budget -= 1.0
        publisher.publish(message.data)
        self._last_sent[message.topic] = message.data
        self._budget -= 1.0
        self._sent += 1

    def _end(self, now_s: float) -> None:
        """End once all subscribers have what was sent."""
        wait = Duration(seconds=ACKNOWLEDGE_S)
        outputs = [output for output in self._outputs.values() if output is not None]
        if not all(output.wait_for_all_acked(wait) for output in outputs):
            if now_s - self._since_s < PATIENCE_S:
                return
            self.get_logger().warning("a subscriber does not acknowledge what was sent; it may lack the end")
        refused = f", {self._failed_bags} left out" if self._failed_bags else ""
        self.get_logger().info(
            f"played {self._played_bags} bags, {self._sent} messages in "
            f"{self._since_s - self._first_sent_s:.1f} s{refused}"
        )
        raise Finished

    def _subscribers(self, topic: str) -> int:
        publisher = self._outputs[topic]
        if publisher is None:
            return 1
        own = topic == JOINT_STATES and self._live_arm.listens
        return max(publisher.get_subscription_count() - own, 0)


def _stamp(time_ns: int) -> Any:
    stamp = Time()
    ns_to_stamp(time_ns, stamp)
    return stamp


def main(argv: list[str] | None = None) -> int:
    """Start the player."""
    return run("player", Player, argv, __doc__)
