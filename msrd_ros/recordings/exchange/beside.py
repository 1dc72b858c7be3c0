"""What a data set cannot hold and is kept beside it: the bags themselves, byte for byte, and the contract.

Rows are taken at the control rate; stamps of single messages, messages between two rows, strokes that were
refused and topics that nobody learns from are in the bags alone. They lie in the folder ``msrd_ros`` within
the data set, where readers of the data set do not look.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath

from msrd_ros import __version__
from msrd_ros.contract.columns import DataContract
from msrd_ros.core.errors import UserError
from msrd_ros.core.files import write_synced
from msrd_ros.core.formats import FORMAT_KEY, require_format
from msrd_ros.recordings.exchange.stroke_set import StrokeSet

FOLDER = "msrd_ros"
CONTRACT_FILE, INDEX_FILE, BAGS = "contract.yaml", "bags.json", "bags"
BESIDE_FORMAT = 1


@dataclass(frozen=True)
class KeptBag:
    """A bag beside a data set.

    Attributes
    ----------
    path
        Below the folder that was exported.
    files
        SHA-256 by name; of a single MCAP file one entry with an empty name.
    strokes
        How many of its strokes are episodes of the data set.
    refused
        Why others are not; empty if all are.
    """

    path: str
    files: Mapping[str, str]
    strokes: int
    refused: str


@dataclass(frozen=True)
class Beside:
    """What ``bags.json`` says.

    Attributes
    ----------
    robot
        `Robot.identity` of the arm that was led.
    topics
        Full topic name in the bags by relative name, where it was said.
    bags
        In the order of their paths.
    """

    robot: str
    topics: Mapping[str, str]
    bags: tuple[KeptBag, ...]


def keep_beside(root: Path, strokes: StrokeSet, contract: DataContract) -> None:
    """Copy the bags into a data set, and say what its columns are.

    Parameters
    ----------
    root
        The data set's folder.
    strokes
        What was exported.
    contract
        What its columns are.
    """
    folder = root / FOLDER
    folder.mkdir()
    counts = Counter(stroke.bag for stroke in strokes.strokes)
    kept = []
    for name, path in strokes.bags.items():
        target = folder / BAGS / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if path.is_file():
            shutil.copyfile(path, target)
        else:
            target.mkdir()
            for file in path.iterdir():
                if file.is_file() and not file.name.startswith("."):
                    shutil.copyfile(file, target / file.name)
        kept.append(KeptBag(name, _sums(target), counts[name], strokes.refused.get(name, "")))
    write_synced(folder / CONTRACT_FILE, contract.to_yaml().encode())
    index = {
        FORMAT_KEY: BESIDE_FORMAT,
        "written_by": f"msrd_ros {__version__}",
        "robot": strokes.robot.identity,
        "topics": dict(strokes.names),
        "bags": [asdict(bag) for bag in kept],
    }
    write_synced(folder / INDEX_FILE, (json.dumps(index, indent=1) + "\n").encode())


def read_beside(root: Path) -> Beside:
    """Read what lies beside a data set.

    Raises
    ------
    UserError
        If nothing does, or it is not understood; says the way out.
    """
    file = root / FOLDER / INDEX_FILE
    if not file.is_file():
        raise UserError(
            f"data set {root}: no bags are kept beside it (no {FOLDER}/{INDEX_FILE}); say with --mapping "
            "FILE which columns are joints and ball"
        )
    try:
        told = json.loads(file.read_text(encoding="utf-8"))
        require_format(told[FORMAT_KEY], BESIDE_FORMAT, str(file))
        bags = tuple(
            KeptBag(str(one["path"]), dict(one["files"]), int(one["strokes"]), str(one["refused"]))
            for one in told["bags"]
        )
        topics = {str(role): str(name) for role, name in told["topics"].items()}
        found = Beside(str(told["robot"]), topics, bags)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise UserError(
            f"{file}: is not readable ({type(error).__name__}: {error}); copy the data set again"
        ) from None
    for bag in bags:
        path = PurePosixPath(bag.path)
        if (
            path.is_absolute()
            or ".." in path.parts
            or any(PurePosixPath(name).name != name for name in bag.files)
        ):
            raise UserError(f"{file}: {bag.path!r} leads out of the folder; use a data set that you trust")
    return found


def kept_path(root: Path, bag: KeptBag) -> Path:
    """Where a bag lies within a data set."""
    return root / FOLDER / BAGS / bag.path


def copy_back(root: Path, bag: KeptBag, folder: Path) -> Path:
    """Copy a bag out of a data set; its new path.

    Raises
    ------
    UserError
        If it is not as it was put there.
    """
    source, target = kept_path(root, bag), folder / bag.path
    if not source.exists() or _sums(source) != dict(bag.files):
        raise UserError(f"data set {root}: the bag {bag.path} beside it was changed; copy the data set again")
    target.parent.mkdir(parents=True, exist_ok=True)
    if source.is_file():
        shutil.copyfile(source, target)
    else:
        shutil.copytree(source, target)
    return target


def _sums(path: Path) -> dict[str, str]:
    files = {"": path} if path.is_file() else {file.name: file for file in sorted(path.iterdir())}
    return {name: hashlib.sha256(file.read_bytes()).hexdigest() for name, file in files.items()}
