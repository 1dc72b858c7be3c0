"""What a study keeps, and the keys under which it does: other settings or other code, another key."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import torch

import msrd_ros
from msrd_ros.core.files import write_atomically

COMPUTING = {"bags", "contract", "core", "learning", "recordings", "robots", "studies", "table_tennis"}


def cache_key(*parts: Any) -> str:
    """Short digest of settings (data for JSON) and code, by which kept results are found again."""
    return sha256(json.dumps([*parts, torch.__version__, code_digest()]).encode()).hexdigest()[:12]


@cache
def code_digest(package: Path = Path(msrd_ros.__file__).parent) -> str:
    """Digest of the sources that compute: of everything but what draws, shows, starts and watches."""
    digest = sha256()
    for path in sorted(package.rglob("*.py")):
        name = path.relative_to(package)
        if name.parts[0] in COMPUTING and path.stem not in ("report", "figures"):
            digest.update(f"{name.as_posix()}\0".encode() + path.read_bytes() + b"\0")
    return digest.hexdigest()


def cached(path: Path, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """The result (data for JSON) that is kept at `path`; if there is none yet, what `make` gives is."""
    if not path.exists():
        write_atomically(path, json.dumps(make()).encode())
    return dict(json.loads(path.read_text()))
