"""Who can find a node: DDS speaks to the whole network unless it is told otherwise."""

from __future__ import annotations

from collections.abc import MutableMapping

DISCOVERY_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
"""ROS's own variable: OFF, LOCALHOST, SUBNET or SYSTEM_DEFAULT."""


def stay_on_this_machine(environment: MutableMapping[str, str]) -> None:
    """Let nodes of this environment meet those of this machine only, unless the user has said otherwise.

    To be called before rclpy starts; what ROS_STATIC_PEERS names is found in any case.
    """
    environment.setdefault(DISCOVERY_RANGE, "LOCALHOST")
