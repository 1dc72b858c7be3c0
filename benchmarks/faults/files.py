"""Damaged files: bags, their metadata, policies, checkpoints, robots and strategies, each mutated at random.

Whatever a file holds, who reads it gets either what it says or a `UserError` that names the file.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import yaml

from faults.trials import Finding, Setting, Trial
from learning_problems import PointMass, point_demonstrations
from made_up_policies import made_up_policies
from msrd_ros.bags.reader import Bag
from msrd_ros.core.errors import UserError
from msrd_ros.core.resources import shipped_bags
from msrd_ros.learning.checkpoints import load_checkpoint
from msrd_ros.learning.cloning import CloningConfig
from msrd_ros.learning.config import MSRDConfig, ReplayConfig
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.recordings.library import BagLibrary
from msrd_ros.robots.loading import default_robot, load_robot
from msrd_ros.table_tennis.strategies.table import Strategies
from msrd_ros.table_tennis.strokes.policies import StrokePolicies

Rng = np.random.Generator
CHECKPOINT = Path(__file__).parents[2] / "test" / "data" / "0.1.0" / "checkpoint.safetensors"
_NASTY: tuple[object, ...] = (
    None, "", "x", -1, 0, 1, 1e308, float("nan"), float("inf"), [], {}, True, "../..", "a" * 300, [None],
    10**30,
)  # fmt: skip


def mutate_bytes(data: bytes, rng: Rng) -> bytes:
    """Flip, cut, repeat, blank or exchange a part."""
    if not data:
        return bytes(rng.integers(0, 256, 16, dtype=np.uint8))
    changed = bytearray(data)
    at = int(rng.integers(len(data)))
    size = min(2 ** int(rng.integers(12)), len(data) - at)
    match int(rng.integers(6)):
        case 0:
            for place in rng.integers(len(data), size=int(rng.integers(1, 9))):
                changed[place] ^= 1 << int(rng.integers(8))
        case 1:
            del changed[at:]
        case 2:
            del changed[at : at + size]
        case 3:
            changed[at:at] = changed[at : at + size]
        case 4:
            changed[at : at + size] = bytes(size)
        case _:
            changed[at : at + size] = rng.integers(0, 256, size, dtype=np.uint8).tobytes()
    return bytes(changed)


def mutate_yaml(data: bytes, rng: Rng) -> bytes:
    """Put a nasty value at a random place of a document, or take it away; sometimes damage its bytes."""
    if rng.random() < 0.3:
        return mutate_bytes(data, rng)
    document = yaml.safe_load(data)
    places: list[tuple[object, object]] = []

    def gather(node: object) -> None:
        items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
        for key, value in items:
            places.append((node, key))
            gather(value)

    gather(document)
    node, key = places[int(rng.integers(len(places)))]
    assert isinstance(node, dict | list)
    if rng.random() < 0.2:
        del node[key]  # type: ignore[arg-type]
    else:
        node[key] = _NASTY[int(rng.integers(len(_NASTY)))]  # type: ignore[call-overload]
    return yaml.safe_dump(document).encode()


def _attempt(finding: Finding, path: Path, number: int, read: Callable[[], object]) -> bool:
    """Read a damaged file; True if it was read, False if it was refused as it should be."""
    finding.tried += 1
    try:
        read()
    except UserError as error:
        if path.name not in str(error):
            finding.break_promise(f"mutation {number}: does not name {path.name}: {error}")
        if "\n" in str(error):
            finding.break_promise(f"mutation {number}: more than one line: {error!r}")
        return False
    except Exception as error:
        finding.break_promise(f"mutation {number}: {type(error).__name__}: {str(error)[:200]}")
        return False
    return True


def _read_bag(path: Path) -> None:
    for info in BagLibrary.scan(path, strict=True).select():
        for episode in read_episodes(Bag(info.path), default_robot()):
            if not (np.isfinite(episode.observations).all() and np.isfinite(episode.actions).all()):
                raise ValueError("an episode that is not finite")


def damaged_bags(setting: Setting) -> Finding:
    """Mutate storage and metadata of shipped bags, and read them as training does."""
    rng, finding = setting.rng("bags"), Finding()
    bags = sorted(path.parent for path in shipped_bags().rglob("metadata.yaml"))
    target = setting.folder / "bag"
    read = 0
    for number in range(setting.count(10_000)):
        bag = bags[int(rng.integers(len(bags)))]
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(bag, target)
        if rng.random() < 0.5:
            path = next(target.glob("*.mcap"))
            path.write_bytes(mutate_bytes(path.read_bytes(), rng))
        else:
            path = target / "metadata.yaml"
            path.write_bytes(mutate_yaml(path.read_bytes(), rng))
        read += _attempt(finding, target, number, lambda: _read_bag(target))
    finding.figures["read all the same"] = read
    return finding


def _damaged(
    setting: Setting, name: str, sources: Sequence[Path], whole: int, read: Callable[[Path], object]
) -> Finding:
    """Mutate single files and read each."""
    rng, finding = setting.rng(name), Finding()
    good = 0
    for number in range(setting.count(whole)):
        source = sources[int(rng.integers(len(sources)))]
        path = setting.folder / f"damaged{source.suffix}"
        mutate = mutate_yaml if source.suffix == ".yaml" else mutate_bytes
        path.write_bytes(mutate(source.read_bytes(), rng))
        good += _attempt(finding, path, number, lambda path=path: read(path))  # type: ignore[misc]
    finding.figures["read all the same"] = good
    return finding


def damaged_policies(setting: Setting) -> Finding:
    """Policies of strokes as the trainer writes them."""
    source = setting.folder / "policies.safetensors"
    source.write_bytes(made_up_policies().to_bytes())
    return _damaged(setting, "policies", [source], 3000, StrokePolicies.load)


def damaged_checkpoints(setting: Setting) -> Finding:
    """Checkpoints of training: what is refused leaves the trainer as it was."""
    config = MSRDConfig(
        iterations=6,
        replay=ReplayConfig(keep=32, replay_share=0.25, snapshot_share=0.25),
        cloning=CloningConfig(steps=30, snapshots=(0, 10)),
    )
    trainer = MSRD(config, point_demonstrations(), BatchedCollector(PointMass()), 99)
    return _damaged(setting, "checkpoints", [CHECKPOINT], 1000, lambda path: load_checkpoint(path, trainer))


def damaged_robots(setting: Setting) -> Finding:
    """Descriptions of arms: the sheet and the URDF."""
    rng, finding = setting.rng("robots"), Finding()
    folder = setting.folder / "robot"
    shutil.copytree(default_robot().folder, folder, dirs_exist_ok=True)
    good = 0
    for number in range(setting.count(2000)):
        path = folder / ("robot.yaml" if rng.random() < 0.7 else "robot.urdf")
        whole = path.read_bytes()
        path.write_bytes((mutate_yaml if path.suffix == ".yaml" else mutate_bytes)(whole, rng))
        good += _attempt(finding, folder, number, lambda: load_robot(folder))
        path.write_bytes(whole)
    finding.figures["read all the same"] = good
    return finding


def damaged_strategies(setting: Setting) -> Finding:
    """The table of strategies."""
    source = Path(__file__).parents[2] / "config" / "strategies.yaml"
    return _damaged(setting, "strategies", [source], 1000, Strategies.read)


_PROMISE = "what it says, or one line that names the file"
TRIALS = (
    Trial("bags", "bags and their metadata, mutated", _PROMISE, damaged_bags),
    Trial("policies", "policies, mutated", _PROMISE, damaged_policies),
    Trial("checkpoints", "checkpoints, mutated", _PROMISE, damaged_checkpoints),
    Trial("robots", "descriptions of arms, mutated", _PROMISE, damaged_robots),
    Trial("strategies", "the table of strategies, mutated", _PROMISE, damaged_strategies),
)
