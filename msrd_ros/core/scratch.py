"""Places to write to where there may be no home directory, as in containers and under service users."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, MutableMapping
from pathlib import Path


def has_home(environment: Mapping[str, str]) -> bool:
    """Whether there is a home directory that can be written to."""
    home = environment.get("HOME")
    return bool(home) and os.access(str(home), os.W_OK)


def scratch_directory() -> Path:
    """A directory under the temporary one that is this user's alone, kept from run to run where possible."""
    scratch = Path(tempfile.gettempdir(), f"msrd_ros-{os.getuid()}")
    scratch.mkdir(mode=0o700, exist_ok=True)
    if scratch.stat().st_uid != os.getuid():
        # Someone else made it: nothing may be loaded from there.
        scratch = Path(tempfile.mkdtemp(prefix="msrd_ros-"))
    return scratch


def cache_directory(environment: Mapping[str, str]) -> Path:
    """Where what can be made again is kept, such as compiled code."""
    if environment.get("XDG_CACHE_HOME"):
        return Path(environment["XDG_CACHE_HOME"])
    return Path(environment["HOME"], ".cache") if has_home(environment) else scratch_directory()


def provide_writable_directories(environment: MutableMapping[str, str]) -> None:
    """Give ROS logs and fonts a place where there is no home directory: without one, rclpy refuses to start.

    What the user has set stays.
    """
    if has_home(environment):
        return
    scratch = scratch_directory()
    environment.setdefault("ROS_LOG_DIR", str(scratch / "ros_log"))
    environment.setdefault("MPLCONFIGDIR", str(scratch / "matplotlib"))
