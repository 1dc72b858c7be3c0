"""The kinds of data sets that bags become and are made of."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from msrd_ros.bags.writer import appearing
from msrd_ros.contract.columns import DataContract, stroke_contract
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.exchange.lerobot_set import read_lerobot, write_lerobot
from msrd_ros.recordings.exchange.minari_set import minari_contract, read_minari, write_minari
from msrd_ros.recordings.exchange.stroke_set import StrokeSet
from msrd_ros.recordings.exchange.table import Table
from msrd_ros.robots.robot import Robot


class Kind(NamedTuple):
    """A kind of data set.

    Attributes
    ----------
    write
        Takes an empty folder, the strokes, the data set's name, and whether to draw pictures.
    read
        Takes a data set's folder.
    contract
        What columns are when an arm's strokes are written.
    """

    write: Callable[[Path, StrokeSet, str, bool], None]
    read: Callable[[Path], Table]
    contract: Callable[[Robot], DataContract]


KINDS: Mapping[str, Kind] = {
    "lerobot": Kind(write_lerobot, read_lerobot, stroke_contract),
    "minari": Kind(write_minari, read_minari, minari_contract),
}
"""By name."""


@contextmanager
def whole_or_absent(target: Path) -> Iterator[Path]:
    """A folder to write into, which becomes `target` when all is written.

    Raises
    ------
    UserError
        If `target` exists or cannot be written.
    """
    try:
        with appearing(target) as aside:
            yield aside
    except FileExistsError:
        raise UserError(f"{target}: exists; name a folder that does not") from None
    except OSError as error:
        raise UserError(
            f"{target}: cannot write: {error.strerror or error}; choose a writable place"
        ) from None
