"""``python -m msrd_ros.bags``: see `msrd_ros.recordings.command`."""

from __future__ import annotations

import sys

from msrd_ros.recordings.command import main

if __name__ == "__main__":
    sys.exit(main())
