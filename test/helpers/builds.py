"""Building the package as users do."""

from __future__ import annotations

import os
import subprocess
import sys
import venv
from importlib.metadata import Distribution, PackageNotFoundError
from itertools import chain
from pathlib import Path

from packaging.requirements import Requirement


def colcon(workspace: Path) -> list[str]:
    """The colcon command of this environment, keeping its log in the workspace."""
    return [sys.executable, "-m", "colcon", "--log-base", str(workspace / "log")]


class BareEnvironment:
    """An environment that has one distribution of the package, what that asks for, and nothing else.

    Dependencies are links to the installed ones, found by following what each distribution asks for without
    extras: whatever nobody asks for is missing, and no network is needed.
    """

    def __init__(self, prefix: Path, distribution: Path) -> None:
        venv.create(prefix, with_pip=False, symlinks=True)
        self.prefix = prefix
        self.bin = prefix / "bin"
        self._libraries = Path(
            self.run("python", "-c", "import sysconfig; print(sysconfig.get_path('purelib'))")
        )
        # A source distribution is built with these; they go again.
        tools = [self._link(name) for name in ("setuptools", "wheel")]
        options = [
            "--quiet",
            "--no-deps",
            "--no-build-isolation",
            "--no-index",
            "--disable-pip-version-check",
        ]
        pip = [sys.executable, "-m", "pip", "--python", str(self.bin / "python"), "install", *options]
        subprocess.run([*pip, str(distribution)], check=True)
        for link in chain.from_iterable(tools):
            link.unlink()
        own = Distribution.discover(name="msrd_ros", path=[str(self._libraries)])
        wanted = [name for one in own for name in _asked(one)]
        linked: set[str] = set()
        while wanted:
            name = wanted.pop()
            if name not in linked:
                linked.add(name)
                self._link(name)
                wanted += _asked(Distribution.from_name(name))

    def run(self, program: str, *arguments: str, code: int = 0) -> str:
        """What a program of the environment prints; it has to end with `code`."""
        clean = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "AMENT"))}
        done = subprocess.run(
            [self.bin / program, *arguments],
            cwd=self.prefix,
            env=clean,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == code, done.stdout + done.stderr
        return (done.stdout or done.stderr).strip()

    def _link(self, name: str) -> list[Path]:
        """Link an installed distribution's folders and modules; none if it is not there."""
        try:
            distribution = Distribution.from_name(name)
        except PackageNotFoundError:
            return []
        made = []
        for top in sorted({file.parts[0] for file in distribution.files or []} - {"..", "__pycache__"}):
            link = self._libraries / top
            if not link.exists():
                link.symlink_to(Path(str(distribution.locate_file(top))))
                made.append(link)
        return made


def _asked(distribution: Distribution) -> list[str]:
    """Names of the distributions that another one asks for without extras."""
    requirements = [Requirement(text) for text in distribution.requires or []]
    return [one.name for one in requirements if one.marker is None or one.marker.evaluate({"extra": ""})]
