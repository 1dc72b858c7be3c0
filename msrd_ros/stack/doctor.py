"""`python -m msrd_ros doctor`: looks at the running stack, and says what keeps it from its work."""

from __future__ import annotations

import argparse
import json
import os
from typing import Any

from msrd_ros.core.errors import UserError
from msrd_ros.stack.findings import Finding, findings
from msrd_ros.stack.looking import Look
from msrd_ros.stack.snapshot import Snapshot

SHORTEST_S = 1.0
HEALTHY, FOUND = 0, 1


def main(argv: list[str] | None = None) -> int:
    """Examine.

    Returns
    -------
    0 if nothing was found, 1 if something was.
    """
    arguments = _parse(argv)
    look = Look(arguments.domain, arguments.namespace)
    try:
        snapshot = look.take(arguments.wait)
    finally:
        look.close()
    found = findings(snapshot)
    print(json.dumps(as_json(snapshot, found), indent=1) if arguments.json else as_text(snapshot, found))
    return FOUND if found else HEALTHY


def _parse(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="doctor", description=__doc__)
    parser.add_argument("--domain", type=int, help="ROS domain to look at; ROS_DOMAIN_ID, or 0")
    parser.add_argument("--namespace", default="/", help="look only at what is in it, such as /left")
    parser.add_argument(
        "--wait",
        type=float,
        default=5.0,
        metavar="S",
        help="listen for S seconds, longer where answers are missing; 5",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object, and nothing else")
    arguments = parser.parse_args(argv)
    if not SHORTEST_S <= arguments.wait <= 3600.0:
        raise UserError(f"--wait {arguments.wait:g}: give {SHORTEST_S:g} to 3600 s")
    if arguments.domain is not None and not 0 <= arguments.domain <= 232:
        raise UserError(f"--domain {arguments.domain}: give 0 to 232")
    if not os.environ.get("ROS_DOMAIN_ID", "0").isdigit():
        raise UserError(f"ROS_DOMAIN_ID is {os.environ['ROS_DOMAIN_ID']!r}; set it to a number, 0 to 101")
    arguments.namespace = "/" + arguments.namespace.strip("/")
    return arguments


def as_json(snapshot: Snapshot, found: list[Finding]) -> dict[str, Any]:
    """What was seen and what is wrong with it, as plain data."""
    return {
        "domain": snapshot.domain,
        "discovery_range": snapshot.discovery_range,
        "other_domains": list(snapshot.other_domains),
        "nodes": {name: _node(snapshot, name) for name in snapshot.nodes},
        "topics": {topic: _topic(snapshot, topic) for topic in snapshot.topics},
        "findings": [finding._asdict() for finding in found],
    }


def _node(snapshot: Snapshot, name: str) -> dict[str, Any]:
    said = snapshot.said.get(name)
    return {
        "says": said.message if said else None,
        "waits_for": said.waits_for if said else "",
        "parameters": dict(snapshot.parameters.get(name, {})),
    }


def _topic(snapshot: Snapshot, topic: str) -> dict[str, Any]:
    heard, age_s = snapshot.heard.get(topic), snapshot.age_s(topic)
    return {
        "publishers": sorted(end.node for end in snapshot.publishers(topic)),
        "subscriptions": sorted({end.node for end in snapshot.subscriptions(topic)}),
        "rate_hz": round(heard.rate_hz, 1) if heard else None,
        "stamp_age_s": None if age_s is None else round(age_s, 3),
    }


def as_text(snapshot: Snapshot, found: list[Finding]) -> str:
    """What was seen, what is wrong with it, and what to do, for people."""
    lines = [f"domain {snapshot.domain}, discovery {snapshot.discovery_range}"]
    lines += ["nodes:" if snapshot.nodes else "nodes: none"]
    for name in snapshot.nodes:
        said = snapshot.said.get(name)
        told = said.message if said else "not of the stack, or silent"
        lines.append(f"  {name}: {told}")
    lines += ["topics:" if snapshot.topics else "topics: none"]
    for topic in snapshot.topics:
        facts = _topic(snapshot, topic)
        rate = "" if facts["rate_hz"] is None else f" {facts['rate_hz']:g} Hz"
        age = "" if facts["stamp_age_s"] is None else f", stamps {facts['stamp_age_s']:g} s old"
        senders, listeners = (", ".join(facts[side]) or "nobody" for side in ("publishers", "subscriptions"))
        lines.append(f"  {topic}{rate}{age}: {senders} -> {listeners}")
    if not found:
        return "\n".join([*lines, "found nothing wrong"])
    lines.append("found:")
    lines += [f"  {number}. {finding.what}" for number, finding in enumerate(found, 1)]
    lines.append("what to do:")
    lines += [f"  {number}. {finding.remedy}" for number, finding in enumerate(found, 1)]
    return "\n".join(lines)
