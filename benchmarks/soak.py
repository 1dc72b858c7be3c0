"""Lets the stack play for hours of lockstep time, and watches memory, file handles and threads of its nodes.

Run from the repository: ``python benchmarks/soak.py [--hours 8] [--out FOLDER]``, or ``make soak``; eight
hours take about one. Exit status: 0 if all stayed flat between the first tenth and the end, 1 if not.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
# Policies, processes and domains made up for the tests.
sys.path[:0] = [str(CHECKOUT), str(CHECKOUT / "test" / "helpers")]
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

from faults.nodes import play  # noqa: E402
from faults.trials import Finding, Setting  # noqa: E402

SAMPLE_S = 30.0
MEMORY_SLACK = 0.1
"""Growth of the memory in use over the run, as a share, that is still called flat."""
COUNT_SLACK = 2


def measure(pid: int) -> dict[str, int]:
    """Memory in use in kB, open file handles and threads of a process (Linux)."""
    facts = dict(
        line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines() if ":" in line
    )
    return {
        "memory_kb": int(facts["VmRSS"].split()[0]),
        "handles": len(list(Path(f"/proc/{pid}/fd").iterdir())),
        "threads": int(facts["Threads"]),
    }


def judge(samples: list[dict[str, int]]) -> list[str]:
    """What has grown from the first tenth of the samples to the last."""
    part = max(len(samples) // 10, 1)
    begin, end = samples[part : 2 * part] or samples[:part], samples[-part:]
    grown = []
    for key in samples[0]:
        before = sum(sample[key] for sample in begin) / len(begin)
        after = sum(sample[key] for sample in end) / len(end)
        allowed = before * (1.0 + MEMORY_SLACK) if key == "memory_kb" else before + COUNT_SLACK
        if after > allowed:
            grown.append(f"{key} from {before:.0f} to {after:.0f}")
    return grown


def main() -> int:
    """Play, sample, judge; exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--hours", type=float, default=8.0, help="of lockstep time")
    parser.add_argument("--out", type=Path, default=Path("out/soak"))
    options = parser.parse_args()
    out = options.out.absolute()
    out.mkdir(parents=True, exist_ok=True)
    finding = Finding()
    samples: dict[str, list[dict[str, int]]] = {}
    begin_s = time.monotonic()
    with play(Setting(out, 1.0, 0), finding) as scene:
        # What is sent is the campaign's; listening to every tick costs a sixth of a core.
        scene.guard.leave_commands()
        first_s = scene.guard.outcome_s
        while scene.guard.outcome_s - first_s < options.hours * 3600.0 and not finding.broken:
            before = scene.guard.outcomes
            scene.spin_for(SAMPLE_S)
            finding.require(scene.guard.outcomes > before, f"no ball in {SAMPLE_S:g} s: {scene.last_words()}")
            for name, process in scene.nodes.items():
                if process.running:
                    samples.setdefault(name, []).append(measure(process.pid))
            hours = (scene.guard.outcome_s - first_s) / 3600.0
            print(f"{hours:.2f} h, {scene.guard.outcomes} balls", file=sys.stderr, flush=True)
        balls, lockstep_s = scene.guard.outcomes, scene.guard.outcome_s - first_s
    for name, taken in samples.items():
        for line in judge(taken):
            finding.break_promise(f"{name}: {line}")
    result = {
        "balls": balls,
        "lockstep_hours": lockstep_s / 3600.0,
        "seconds": time.monotonic() - begin_s,
        "first": {name: taken[0] for name, taken in samples.items()},
        "last": {name: taken[-1] for name, taken in samples.items()},
        "broken": finding.told,
    }
    text = json.dumps(result, indent=2)
    (out / "soak.json").write_text(text + "\n", encoding="utf-8")
    print(text)
    return int(finding.broken > 0)


if __name__ == "__main__":
    sys.exit(main())
