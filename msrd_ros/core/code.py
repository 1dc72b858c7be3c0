"""What computes: a digest of the sources, and the versions of all that a result depends on."""

from __future__ import annotations

import platform
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import msrd_ros

COMPUTING = {"bags", "contract", "core", "learning", "recordings", "robots", "studies", "table_tennis"}
LIBRARIES = ("gymnasium", "mujoco", "numba", "numpy", "pybullet", "scipy", "torch")


@cache
def code_digest(package: Path = Path(msrd_ros.__file__).parent) -> str:
    """Digest of the sources that compute: of everything but what draws, shows, starts and watches."""
    digest = sha256()
    for path in sorted(package.rglob("*.py")):
        name = path.relative_to(package)
        if name.parts[0] in COMPUTING and path.stem not in ("report", "figures", "tables"):
            digest.update(f"{name.as_posix()}\0".encode() + path.read_bytes() + b"\0")
    return digest.hexdigest()


@cache
def fingerprint() -> tuple[tuple[str, str], ...]:
    """What has to be alike for the same seeds to give the same bits, by name; libraries that are there."""
    found = {"Python": platform.python_version(), "code of msrd_ros": code_digest()[:12]}
    for library in LIBRARIES:
        try:
            found[library] = version(library)
        except PackageNotFoundError:
            found[library] = "not installed"
    return tuple(found.items())
