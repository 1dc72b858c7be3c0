"""The examples of the documents run, and the README shows the one that it says it shows."""

from __future__ import annotations

import subprocess
import sys

import pytest

from processes import CHECKOUT

EXAMPLES = CHECKOUT / "docs" / "examples"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("own_bags", "('forehand-push', 'backhand-slice') as"),
        ("own_environment", "2 strategies"),
        ("discover", "doubted: (0,)\n2 strategies"),
        ("new_teacher", "strategies: left middle right far\n"),
        ("own_method", "MSRD without cross-negatives 0.0"),
    ],
)
def test_example_runs(name: str, said: str) -> None:
    result = subprocess.run(
        [sys.executable, str(EXAMPLES / f"{name}.py")], capture_output=True, text=True, timeout=120
    )
    assert result.returncode == 0, result.stderr
    assert said in result.stdout


def test_readme_shows_the_quickstart() -> None:
    code = (EXAMPLES / "quickstart.py").read_text(encoding="utf-8").strip()
    assert f"```python\n{code}\n```" in (CHECKOUT / "README.md").read_text(encoding="utf-8")
