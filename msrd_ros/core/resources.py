"""Where the package's own files lie: parameter files and the bags that it ships.

They are found in a source checkout, in a colcon overlay and in a pip environment alike, with or without
``AMENT_PREFIX_PATH``: the wheels of rclpy do not set it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from msrd_ros.core.errors import UserError

PACKAGE = "msrd_ros"
_INDEX_MARKER = Path("share", "ament_index", "resource_index", "packages", PACKAGE)


def share_directory() -> Path:
    """Directory that holds ``config/``, ``launch/``, ``bags/`` and ``package.xml``.

    Those that belong to the running code come first: in its checkout, else in the prefix that it is installed
    under. Then the ament index (``AMENT_PREFIX_PATH``) and the environment's own prefix are asked.

    Raises
    ------
    UserError
        If the package is installed without them.
    """
    code = Path(__file__).resolve()
    checkout = code.parents[2]
    if (checkout / "package.xml").is_file() and (checkout / "config").is_dir():
        return checkout
    for prefix in _prefixes(code):
        if (prefix / _INDEX_MARKER).is_file():
            return prefix / "share" / PACKAGE
    raise UserError(
        f"{PACKAGE}: its config and bags are neither beside {code.parents[1]} nor in the ament index; "
        "install it with `pip install .` or build it with `colcon build` and source install/setup.bash"
    )


def shipped_bags() -> Path:
    """Folder of the recorded strokes that come with the package.

    Raises
    ------
    UserError
        If it is missing; names it.
    """
    path = share_directory() / "bags"
    if not path.is_dir():
        raise UserError(
            f"folder {path}: not found; record strokes with `recorder`, or install {PACKAGE} again"
        )
    return path


def _prefixes(code: Path) -> Iterator[Path]:
    yield from code.parents
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield Path(prefix)
    yield Path(sys.prefix)
