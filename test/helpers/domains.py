"""ROS domains that nobody else on this machine tests on, and observers on them."""

from __future__ import annotations

import itertools
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager

import rclpy
from rclpy.context import Context
from rclpy.node import Node

HIGHEST_DOMAIN_ID = 101
"""Above this, Fast DDS's ports meet those that Linux hands out."""

_TURNS = itertools.count()


@contextmanager
def reserved_domain() -> Iterator[int]:
    """Keep a domain from all other tests for as long as the context lasts.

    Each time it is another one: what killed processes leave in shared memory is no good company.
    """
    first = os.getpid() + next(_TURNS)
    # A bound abstract socket is a lock that the kernel drops with the process, and leaves no file.
    with socket.socket(socket.AF_UNIX) as reservation:
        for attempt in range(HIGHEST_DOMAIN_ID):
            candidate = 1 + (first + attempt) % HIGHEST_DOMAIN_ID
            try:
                reservation.bind(f"\0msrd_ros test domain {candidate}")
            except OSError:
                continue
            break
        else:
            raise RuntimeError("no free ROS domain: end other test runs")
        yield candidate


def open_observer(domain_id: int) -> Node:
    """A node of the test's own on a domain, in a context of its own."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain_id)
    # Observers have one name, and two of it in a process would share one publisher of /rosout.
    return Node("test_observer", context=context, enable_rosout=False)


def close_observer(node: Node) -> None:
    """End it and its context."""
    node.destroy_node()
    node.context.try_shutdown()


@contextmanager
def observer(domain_id: int) -> Iterator[Node]:
    """An observer for as long as the context lasts."""
    node = open_observer(domain_id)
    try:
        yield node
    finally:
        close_observer(node)
