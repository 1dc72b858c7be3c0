#!/usr/bin/env python3
"""Start the executable of msrd_ros that this file is named like; all of ``lib/msrd_ros`` is this file.

`ros2 run` and launch files start it directly, so whichever Python comes first on the PATH reads it. The
command ``msrd_ros``, which colcon installs beside it and pip in ``bin/``, knows the Python that the package
was installed for, activated or not.
"""

import os
import sys


def main() -> None:
    """Become the command ``msrd_ros`` of this installation, with this file's name as its first argument."""
    path = os.path.abspath(__file__)
    directory, name = os.path.split(path)
    for commands in (directory, os.path.join(directory, "..", "..", "bin")):
        command = os.path.join(commands, "msrd_ros")
        if os.path.isfile(command):
            os.execv(command, [command, name, *sys.argv[1:]])
    sys.exit(f"{path}: error: msrd_ros is not installed here; use python3 -m msrd_ros {name}")


if __name__ == "__main__":
    main()
