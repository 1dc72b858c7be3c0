"""Keys under which a study keeps its results: other settings, another key."""

from __future__ import annotations

import json
from hashlib import sha256
from typing import Any

import torch


def digest(*parts: Any) -> str:
    """Short digest of settings (data for JSON), by which kept results are found again."""
    return sha256(json.dumps([*parts, torch.__version__]).encode()).hexdigest()[:12]
