"""Where work is done, as users say it: ``local``, ``ray`` or ``ray://HOST:PORT``."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass

from msrd_ros.cluster.on_ray import ADDRESS_VARIABLE, RayWorkers
from msrd_ros.cluster.processes import Processes, ThisProcess
from msrd_ros.cluster.workers import Workers
from msrd_ros.core.errors import UserError

LOCAL, RAY = "local", "ray"
WORKERS = 2
"""Processes, or processors of a Ray of our own, where nobody says how many."""


@dataclass(frozen=True)
class Place:
    """Where work is done.

    Attributes
    ----------
    uses_ray
        Whether Ray does it.
    address
        Of a cluster of Ray; None: on this machine alone.
    """

    uses_ray: bool = False
    address: str | None = None

    @classmethod
    def parse(cls, text: str, what: str) -> Place:
        """Read what a user has said; the address in `ADDRESS_VARIABLE` counts only where Ray is asked for.

        Parameters
        ----------
        what
            What an error says was wrong, such as the name of an option.

        Raises
        ------
        UserError
            If it is none of the three.
        """
        if text == LOCAL:
            return cls()
        if text == RAY:
            return cls(True, os.environ.get(ADDRESS_VARIABLE) or None)
        if re.fullmatch(r"ray://[^\s/:]+:\d{1,5}", text):
            return cls(True, text)
        raise UserError(f"{what} {text}: say {LOCAL}, {RAY} or ray://HOST:PORT")

    def open(self, count: int = WORKERS) -> Workers:
        """Workers there.

        Parameters
        ----------
        count
            Processes, or processors of a Ray of our own; 0 does everything in this process. A cluster has as
            many as it has.
        """
        if self.uses_ray:
            return RayWorkers(self.address, count)
        return Processes(count) if count else ThisProcess()
