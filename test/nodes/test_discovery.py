"""Nodes stay on this machine unless the user opens them to the network."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from msrd_ros.core.discovery import DISCOVERY_RANGE, stay_on_this_machine

DISCOVERY_PORT, PORTS_A_DOMAIN = 7400, 250
"""Where DDS participants call into the network: RTPS's formula for a domain's multicast port."""

OPEN_PORTS = """
import os
from pathlib import Path
from rclpy.node import Node
from msrd_ros.nodes.common import Finished, run

def look():
    node = Node("looking")
    links = [os.path.realpath(f"/proc/self/fd/{name}") for name in os.listdir("/proc/self/fd")]
    own = {link.rpartition("[")[2].rstrip("]") for link in links if "socket:[" in link}
    rows = [line.split() for line in Path("/proc/self/net/udp").read_text().splitlines()[1:]]
    print("ports:", *(int(row[1].split(":")[1], 16) for row in rows if row[9] in own), flush=True)
    node.destroy_node()
    raise Finished(0)

raise SystemExit(run("looking", look, []))
"""


def open_ports(environment: dict[str, str]) -> set[int]:
    """UDP ports that a node of this environment opens."""
    code = [sys.executable, "-c", OPEN_PORTS]
    done = subprocess.run(code, env=environment, capture_output=True, text=True, timeout=120, check=True)
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("ports:"))
    return {int(word) for word in line.split()[1:]}


def test_what_the_user_has_set_stays() -> None:
    unset: dict[str, str] = {}
    stay_on_this_machine(unset)
    assert unset == {DISCOVERY_RANGE: "LOCALHOST"}
    said = {DISCOVERY_RANGE: "SUBNET"}
    stay_on_this_machine(said)
    assert said == {DISCOVERY_RANGE: "SUBNET"}


@pytest.mark.processes
def test_a_node_calls_into_the_network_only_if_it_is_told_to(domain_id: int) -> None:
    environment = {key: value for key, value in os.environ.items() if key != DISCOVERY_RANGE}
    port = DISCOVERY_PORT + PORTS_A_DOMAIN * domain_id
    silent = open_ports(environment)
    assert silent
    assert port not in silent
    assert port in open_ports({**environment, DISCOVERY_RANGE: "SUBNET"})
