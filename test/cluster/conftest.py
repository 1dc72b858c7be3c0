"""Ray stays on the loopback interface; it reads this once, as it is imported."""

from __future__ import annotations

import os

os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"
