"""What a study keeps, and the keys under which it does: other settings or other code, another key."""

from __future__ import annotations

import json
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import torch

from msrd_ros.core.code import code_digest
from msrd_ros.core.files import write_atomically


def cache_key(*parts: Any) -> str:
    """Short digest of settings (data for JSON) and code, by which kept results are found again."""
    return sha256(json.dumps([*parts, torch.__version__, code_digest()]).encode()).hexdigest()[:12]


def cached(path: Path, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """The result (data for JSON) that is kept at `path`; if there is none yet, what `make` gives is."""
    if not path.exists():
        write_atomically(path, json.dumps(make()).encode())
    return dict(json.loads(path.read_text()))
