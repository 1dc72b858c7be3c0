"""The topics that a stroke's bag carries: names, types and quality of service of the contract."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

from msrd_ros.core.errors import UserError

JOINT_STATES = "joint_states"
BALL_POSITION = "ball/position"
BALL_ODOMETRY = "ball/odometry"
FEED = "feed"
STRATEGY = "strategy"
OUTCOME = "rally/outcome"
ROBOT_DESCRIPTION = "robot_description"
TF_STATIC = "/tf_static"

STROKE = (JOINT_STATES, BALL_POSITION, FEED, STRATEGY, OUTCOME)
"""The topics that tell of a stroke."""


@dataclass(frozen=True)
class TopicFacts:
    """One topic of the contract.

    Attributes
    ----------
    name
        Relative name, as in the contract; a bag holds the name it had when it was recorded.
    type_name
        For example ``sensor_msgs/msg/JointState``.
    depth
        How many messages a publisher keeps.
    latched
        Whether a late joiner still gets the newest (transient local).
    """

    name: str
    type_name: str
    depth: int
    latched: bool = False


CONTRACT: Mapping[str, TopicFacts] = MappingProxyType(
    {
        facts.name: facts
        for facts in (
            TopicFacts(JOINT_STATES, "sensor_msgs/msg/JointState", 1000),
            TopicFacts(BALL_POSITION, "geometry_msgs/msg/PointStamped", 1000),
            TopicFacts(FEED, "nav_msgs/msg/Odometry", 100),
            TopicFacts(STRATEGY, "std_msgs/msg/Header", 1, latched=True),
            TopicFacts(OUTCOME, "diagnostic_msgs/msg/DiagnosticArray", 100),
            TopicFacts(ROBOT_DESCRIPTION, "std_msgs/msg/String", 1, latched=True),
            TopicFacts(TF_STATIC, "tf2_msgs/msg/TFMessage", 1, latched=True),
            TopicFacts(BALL_ODOMETRY, "nav_msgs/msg/Odometry", 1000),
        )
    }
)
"""Topics by relative name. `ball/odometry` is ground truth: recorded only on request, never learned from."""

LATCHED_TOPICS = tuple(name for name, facts in CONTRACT.items() if facts.latched)
"""Those whose newest message may be much older than the stroke that it belongs to."""


class BagTopic(NamedTuple):
    """A topic as a bag holds it.

    Attributes
    ----------
    name
        Full name, for example ``/joint_states``.
    type_name
        For example ``sensor_msgs/msg/JointState``.
    reliable, latched, depth
        What its publishers offered: reliable or best effort, transient local or volatile, history depth.
    """

    name: str
    type_name: str
    reliable: bool = True
    latched: bool = False
    depth: int = 1000


class BagMessage(NamedTuple):
    """A serialised message of a bag.

    Attributes
    ----------
    topic
        Full name of its topic.
    data
        CDR with its four bytes of encapsulation, as rclpy gives and takes it.
    log_time_ns, publish_time_ns
        When it was received and when it was sent, in nanoseconds of the recorder's clock.
    sequence
        Number that the publisher gave it; 0 if unknown.
    """

    topic: str
    data: bytes
    log_time_ns: int
    publish_time_ns: int
    sequence: int = 0


def say_topic(role: str, name: str = "NAME") -> str:
    """How a user says which topic of a bag plays a part: to a node, and to the command `check`."""
    return f"say which one it is: topics:='[\"{role}:={name}\"]', or --topics {role}:={name} to check"


def parse_topic_names(entries: list[str], where: str) -> dict[str, str]:
    """Read overrides such as ``joint_states:=/lab/joint_states``.

    Returns
    -------
    Full name in the bag by the contract's relative name.

    Raises
    ------
    UserError
        If an entry is not understood or names no topic of the contract.
    """
    names: dict[str, str] = {}
    for entry in entries:
        role, separator, name = entry.partition(":=")
        if not separator or role not in CONTRACT or not name:
            raise UserError(
                f"{where}: {entry!r} is not understood; write NAME:=NAME_IN_BAG with NAME one of "
                f"{', '.join(CONTRACT)}"
            )
        names[role] = name
    return names


def find_topics(types: Mapping[str, str], names: Mapping[str, str], where: str) -> dict[str, str]:
    """Tell which of a bag's topics plays which part of the contract.

    A topic is found by the name that `names` gives, else by its own name at the root, else by the only
    topic whose name ends in it (a namespace) and whose type is right.

    Parameters
    ----------
    types
        Type name by full topic name, as the bag holds them.
    names
        Full name by relative name, where the user has said so.

    Returns
    -------
    Full name by relative name, of those that the bag has.

    Raises
    ------
    UserError
        If a given name is absent or of another type, or several topics fit.
    """
    found: dict[str, str] = {}
    for role, facts in CONTRACT.items():
        given = names.get(role)
        if given is not None:
            if given not in types:
                raise UserError(f"{where}: has no topic {given}; it has {', '.join(sorted(types)) or 'none'}")
            candidates = [given]
        else:
            root = f"/{role.lstrip('/')}"
            candidates = [name for name in types if name == root] or [
                name for name in types if name.endswith(root) and types[name] == facts.type_name
            ]
        if given is None and role not in STROKE and [types[name] for name in candidates] != [facts.type_name]:
            continue  # not needed, so that others may use its name as they like
        if len(candidates) > 1:
            raise UserError(
                f"{where}: {' and '.join(sorted(candidates))} may both be {role}; "
                f"{say_topic(role, sorted(candidates)[0])}"
            )
        for name in candidates:
            if types[name] != facts.type_name:
                raise UserError(
                    f"{where}: topic {name} is a {types[name]}, not a {facts.type_name}; "
                    f"record {role} as the interface says, or {say_topic(role)}"
                )
            found[role] = name
    return found
