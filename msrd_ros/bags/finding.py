"""Bags below a folder: rosbag2 directories and single MCAP files, each once, whatever links lead to it."""

from __future__ import annotations

import os
from collections import deque
from pathlib import Path

from msrd_ros.bags.info import is_one_recording
from msrd_ros.bags.lone_mcap import MCAP_SUFFIX
from msrd_ros.bags.metadata import METADATA_FILE
from msrd_ros.core.errors import UserError

_SQLITE_SUFFIX = ".db3"


def require_bags_at(path: Path, named: str) -> None:
    """Refuse a path at which no bags can be.

    Raises
    ------
    UserError
        If it does not exist or is another file; begins with what it is `named`.
    """
    if not path.is_dir() and not (path.is_file() and path.suffix == MCAP_SUFFIX):
        state = "is a file" if path.exists() else "does not exist"
        raise UserError(f"{named}: {state}; give a folder of bags, a bag's directory or an MCAP file")


def find_bags(root: Path, seen: set[str] | None = None) -> list[Path]:
    """Paths of the bags at or below a folder, in order.

    A directory with metadata is a bag, and so is one that holds nothing but one recording's MCAP files; any
    other MCAP file is one by itself. Hidden directories are passed over. Links are followed, also in circles:
    a bag counts once, by its real path where that lies below `root`.

    Parameters
    ----------
    root
        A folder, a bag's directory or an MCAP file.
    seen
        Real paths that count no more; those that are found are added.
    """
    seen = set() if seen is None else seen
    found: list[Path] = []
    waiting = deque([root])
    while waiting:
        start = waiting.popleft()
        if start.is_dir():
            bags, links = _walk(start, seen)
            waiting += links
        else:
            bags = [start]
        for path in bags:
            real = os.path.realpath(path)
            if real not in seen:
                seen.add(real)
                found.append(path)
    return sorted(found)


def _walk(start: Path, seen: set[str]) -> tuple[list[Path], list[Path]]:
    """Bags below a folder without following links, and the links."""
    bags: list[Path] = []
    links: list[Path] = []
    for name, subfolders, files in os.walk(start):
        folder = Path(name)
        real = os.path.realpath(folder)
        if real in seen:
            subfolders.clear()
            continue
        subfolders[:] = sorted(entry for entry in subfolders if not entry.startswith("."))
        recordings = sorted(file for file in files if file.endswith(MCAP_SUFFIX) and file[0] != ".")
        described = METADATA_FILE in files or any(file.endswith(_SQLITE_SUFFIX) for file in files)
        if described or (not subfolders and is_one_recording(os.path.basename(real), recordings)):
            subfolders.clear()
            bags.append(folder)
            continue
        seen.add(real)
        paths = [folder / entry for entry in (*recordings, *subfolders)]
        links += [path for path in paths if path.is_symlink()]
        bags += [folder / file for file in recordings if not (folder / file).is_symlink()]
    return bags, links
