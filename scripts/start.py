#!/usr/bin/env python3
"""Start the executable of msrd_ros that this file is named like; all of ``lib/msrd_ros`` is this file.

`ros2 run` and launch files start it directly, so the first Python on the PATH reads it. Where it lies in a
virtual environment, that environment's own Python takes over, activated or not.
"""

import os
import sys


def enter_environment() -> None:
    """Go on under the Python of the virtual environment that holds this file, if one does."""
    prefix = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
    python = os.path.join(prefix, "bin", "python3")
    elsewhere = os.path.realpath(prefix) != os.path.realpath(sys.prefix)
    if elsewhere and os.path.exists(os.path.join(prefix, "pyvenv.cfg")) and os.path.exists(python):
        os.execv(python, [python, *sys.argv])


# Worker processes of multiprocessing read this file too, and must not start a second node.
if __name__ == "__main__":
    enter_environment()
    from msrd_ros.__main__ import main

    sys.exit(main([os.path.basename(__file__), *sys.argv[1:]]))
