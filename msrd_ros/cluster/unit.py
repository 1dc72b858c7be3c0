"""One piece of work, and what a worker makes of it: the same wherever the worker is."""

from __future__ import annotations

import os
import pickle
import platform
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from threadpoolctl import threadpool_limits

from msrd_ros.core.code import fingerprint
from msrd_ros.core.compiled_cache import choose_compiled_cache
from msrd_ros.core.errors import UserError
from msrd_ros.core.scratch import provide_writable_directories

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Unit:
    """One piece of work, which depends on nothing but what it is given.

    Attributes
    ----------
    name
        What it is called where its progress or its failure is told.
    arguments
        Of the function, after what all units share; picklable.
    """

    name: str
    arguments: tuple[Any, ...]


@dataclass(frozen=True)
class Failure:
    """Why a unit has no result.

    Attributes
    ----------
    text
        The traceback, or the line that is meant for the user.
    is_users
        Whether it was a `UserError`.
    """

    text: str
    is_users: bool = False


class Call:
    """A function with its arguments, packed for a worker that has to have the same code."""

    def __init__(self, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        self._packed = pickle.dumps((function, arguments))
        self._fingerprint = fingerprint()

    def perform(self, shared: bytes) -> bytes:
        """Call the function with what all units share (pickled) and its own arguments; runs in the worker.

        Everything is unpickled anew for each unit, so that none sees what another one has changed. What the
        function runs into is part of the answer and no exception of the worker's.

        Returns
        -------
        bytes
            Pickled result, or `Failure`.
        """
        try:
            self._require_same_code()
            function, arguments = pickle.loads(self._packed)
            given = pickle.loads(shared)
            # Once more than by the environment: a worker may have loaded its libraries before it was one.
            with threadpool_limits(1):
                return pickle.dumps(function(given, *arguments))
        except UserError as error:
            return pickle.dumps(Failure(str(error), True))
        except (Exception, SystemExit):
            return pickle.dumps(Failure(traceback.format_exc()))

    def _require_same_code(self) -> None:
        for (name, wanted), (_, found) in zip(self._fingerprint, fingerprint(), strict=True):
            if wanted != found:
                raise UserError(
                    f"a worker on {platform.node()} has {name} {found}, and here it is {wanted}: install the "
                    "same on all machines, or results would depend on where they are computed"
                )


def become_worker() -> None:
    """Make this process fit for units, before it loads anything heavy: one thread, and places to write to."""
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    provide_writable_directories(os.environ)
    choose_compiled_cache(os.environ)
