"""The paddle's blade, the same whoever holds it."""

from __future__ import annotations

BLADE_RADIUS_M = 0.075
BLADE_THICKNESS_M = 0.012
