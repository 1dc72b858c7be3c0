"""What a bag says of itself: from its ``metadata.yaml`` of any version, or from MCAP files that have none."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from msrd_ros.bags.lone_mcap import MCAP_SUFFIX, read_mcap_facts, repair_command
from msrd_ros.bags.metadata import FORMAT_KEY, METADATA_FILE, ROOT_KEY, STROKE_FORMAT, split_name
from msrd_ros.contract.labels import StrategyLabel, read_label, say_label
from msrd_ros.core.errors import UserError
from msrd_ros.core.formats import FIRST_FORMAT, require_format

_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(frozen=True)
class BagInfo:
    """What a bag's metadata says, without reading a message.

    Attributes
    ----------
    path
        The bag's directory, or its only file: an MCAP file needs no directory of its own.
    label
        The strategy that it says it shows, in `custom_data` or by its name; None if it does not say.
    subject, outcome
        Who showed the stroke and what became of the ball; empty if it does not say.
    kept
        Whether the recorder accepted the stroke; foreign bags count as accepted.
    message_count, duration_ns, start_ns
        As in the metadata.
    types
        Type name by full topic name.
    files
        Names of the storage files.
    storage
        ``mcap`` or ``sqlite3``.
    packed
        Whether rosbag2 compressed whole files or single messages; MCAP's own chunks do not count.
    custom_data
        All that the metadata carries besides.
    """

    path: Path
    label: StrategyLabel | None
    subject: str
    outcome: str
    kept: bool
    message_count: int
    duration_ns: int
    start_ns: int
    types: Mapping[str, str]
    files: tuple[str, ...]
    storage: str
    packed: bool
    custom_data: Mapping[str, str]

    @property
    def unlabelled(self) -> bool:
        """Whether it says that its stroke has no label; one that says nothing may have it in its headers."""
        return self.label is None and "label" in self.custom_data

    @property
    def folder(self) -> Path:
        """Where its files lie."""
        return self.path if self.path.is_dir() else self.path.parent


def read_info(path: Path) -> BagInfo:
    """Read a bag's metadata; of an MCAP file without ``metadata.yaml``, what it says of itself.

    Parameters
    ----------
    path
        The bag's directory, or an MCAP file.

    Raises
    ------
    UserError
        If `path` is no bag, its metadata is broken, its files are missing, empty, torn or damaged, or its
        name and `custom_data` disagree on the label. Names the bag and says what to do.
    """
    folder = path.parent if path.is_file() else path
    if path.is_file():
        if path.suffix != MCAP_SUFFIX:
            raise UserError(f"bag {path}: is a file; name the bag's directory or an {MCAP_SUFFIX} file")
    elif not path.is_dir():
        state = "is a link that leads nowhere" if path.is_symlink() else "does not exist"
        raise UserError(f"bag {path}: {state}; name the bag's directory or an {MCAP_SUFFIX} file")
    if (folder / METADATA_FILE).is_file() and not (path.is_file() and _is_part(path)):
        return replace(_read_described(folder), path=path)
    files = [path] if path.is_file() else sorted(path.glob(f"*{MCAP_SUFFIX}"))
    if not files:
        raise UserError(f"bag {path}: has no {METADATA_FILE}, so it is no bag; name a rosbag2 directory")
    return _read_undescribed(path, files)


def how_to_rebuild(path: Path) -> str:
    """What to do about a bag whose files may be whole though its metadata are not."""
    if any(path.glob(f"*{MCAP_SUFFIX}")):
        return f"rebuild the bag with: {repair_command(path)}"
    return "copy the bag again, or leave it out"


def is_one_recording(folder: str, files: Sequence[str]) -> bool:
    """Whether MCAP files without metadata are one bag: a single one, or named as rosbag2 splits a bag."""
    pattern = re.compile(rf"{re.escape(folder)}_\d+{re.escape(MCAP_SUFFIX)}")
    return len(files) == 1 or (bool(files) and all(pattern.fullmatch(name) for name in files))


def _is_part(file: Path) -> bool:
    """Whether the metadata beside a file are of more, or of other files, than this one."""
    try:
        return _read_described(file.parent).files != (file.name,)
    except UserError:
        return True


def _read_undescribed(path: Path, files: Sequence[Path]) -> BagInfo:
    folder = path.resolve().name
    if not is_one_recording(folder, [file.name for file in files]):
        raise UserError(f"bag {path}: has no {METADATA_FILE} and {len(files)} recordings; name one of them")
    facts = [read_mcap_facts(file, path) for file in files]
    custom = dict(facts[-1].custom_data)
    count = sum(part.message_count for part in facts)
    start_ns = min((part.start_ns for part in facts if part.message_count), default=0)
    types = {name: kind for part in facts for name, kind in part.types.items()}
    return _info(
        path,
        custom,
        message_count=count,
        duration_ns=max(part.end_ns for part in facts) - start_ns,
        start_ns=start_ns,
        types=types,
        files=tuple(file.name for file in files),
        storage="mcap",
        packed=False,
    )


def _read_described(path: Path) -> BagInfo:
    root = load_metadata(path)
    try:
        custom = {str(key): str(value) for key, value in (root.get("custom_data") or {}).items()}
        types = {
            str(entry["topic_metadata"]["name"]): str(entry["topic_metadata"]["type"])
            for entry in root["topics_with_message_count"]
        }
        # Bags of the first versions hold paths relative to the directory above.
        files = tuple(Path(name).name for name in root["relative_file_paths"])
        message_count = int(root["message_count"])
        duration_ns = int(root["duration"]["nanoseconds"])
        start_ns = int(root["starting_time"]["nanoseconds_since_epoch"])
        storage = str(root["storage_identifier"])
        packed = str(root.get("compression_mode") or "").lower() not in ("", "none")
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise UserError(
            f"bag {path}: {METADATA_FILE} is broken ({type(error).__name__}: {error}); {how_to_rebuild(path)}"
        ) from None
    for name in files:
        file = path / name
        if not file.is_file() or not file.stat().st_size:
            state = "is empty" if file.is_file() else "is missing"
            raise UserError(f"bag {path}: its file {name} {state}; copy the bag again, or leave it out")
    return _info(
        path,
        custom,
        message_count=message_count,
        duration_ns=duration_ns,
        start_ns=start_ns,
        types=types,
        files=files,
        storage=storage,
        packed=packed,
    )


def _info(path: Path, custom: Mapping[str, str], **facts: Any) -> BagInfo:
    if not facts["message_count"]:
        raise UserError(f"bag {path}: holds no messages; record it again, or leave it out")
    require_format(custom.get(FORMAT_KEY, FIRST_FORMAT), STROKE_FORMAT, f"bag {path}")
    return BagInfo(
        path=path,
        label=_stated_label(path, custom),
        subject=custom.get("subject", ""),
        outcome=custom.get("outcome", ""),
        kept=custom.get("kept", "true") == "true",
        custom_data=custom,
        **facts,
    )


def load_metadata(path: Path) -> dict[str, Any]:
    """All that a bag's ``metadata.yaml`` says, below its root key.

    Raises
    ------
    UserError
        If it cannot be read; names the bag and says what to do.
    """
    file = path / METADATA_FILE
    try:
        root = yaml.load(file.read_text(encoding="utf-8"), Loader=_Loader)[ROOT_KEY]
        if not isinstance(root, dict):
            raise TypeError(f"{ROOT_KEY} is {type(root).__name__}")
    except Exception as error:  # text from elsewhere makes the parser stumble in many ways
        reason = (str(error).splitlines() or [""])[0]
        raise UserError(
            f"bag {path}: {METADATA_FILE} is not readable ({type(error).__name__}: {reason}); "
            f"{how_to_rebuild(path)}"
        ) from None
    return root


def _stated_label(path: Path, custom: Mapping[str, str]) -> StrategyLabel | None:
    """The label that custom_data and the directory's name agree on."""
    real = path.resolve()
    # rosbag2 calls a bag's files <name>_<n>.mcap.
    part_of_folder = path.is_file() and real.stem.startswith(f"{real.parent.name}_")
    named = split_name(real.parent.name if part_of_folder else real.stem if path.is_file() else real.name)
    if "label" not in custom:
        return StrategyLabel.parse_optional(named[0]) if named else None
    label = read_label(custom["label"], f"bag {path}: custom_data")
    if named and named[0] != say_label(label):
        raise UserError(
            f"bag {path}: custom_data says {say_label(label)}, the directory's name {named[0]}; "
            f"rename it or leave the bag out"
        )
    return label
