"""Demonstrators as data files: safetensors with the recipe and the report in the header."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import torch
from safetensors import SafetensorError
from safetensors.torch import load as load_tensors
from safetensors.torch import save as save_tensors
from torch import Tensor

from msrd_ros.core.errors import UserError
from msrd_ros.core.files import write_atomically
from msrd_ros.core.formats import FIRST_FORMAT, FORMAT_KEY, require_format
from msrd_ros.studies.shared.task import Demonstrators

DEMONSTRATORS_FORMAT = 1

T = TypeVar("T")
M = TypeVar("M", bound=Demonstrators)


def write_demonstrators(path: Path, recipe: Any, report: dict[str, Any], tensors: dict[str, Tensor]) -> None:
    """Write tensors with a recipe (a dataclass) and a report (data for JSON)."""
    header = {FORMAT_KEY: DEMONSTRATORS_FORMAT, "recipe": asdict(recipe), "report": report}
    write_atomically(path, save_tensors(tensors, metadata={"msrd_ros": json.dumps(header)}))


def remake(
    names: Iterable[str],
    load: Callable[[str], M],
    make: Callable[[Any, Callable[[str], None]], M],
    save: Callable[[str, M], None],
) -> None:
    """Make kept demonstrators again from the recipes in their headers.

    Parameters
    ----------
    names
        Which.
    load, make, save
        Those of a name, those of a recipe, and where they go.
    """
    torch.set_num_threads(1)
    for name in names:
        made = make(load(name).recipe, partial(print, flush=True))
        print(json.dumps(made.report), flush=True)
        save(name, made)


def read_demonstrators(
    path: Path, make: Callable[[dict[str, Any], dict[str, Any], dict[str, Tensor]], T]
) -> T:
    """What `make` makes of recipe, report and tensors of a file of `write_demonstrators`.

    Raises
    ------
    UserError
        If the file is missing, damaged or of a newer format.
    """
    try:
        data = path.read_bytes()
        length = int.from_bytes(data[:8], "little")
        header = json.loads(json.loads(data[8 : 8 + length])["__metadata__"]["msrd_ros"])
        require_format(header.get(FORMAT_KEY, FIRST_FORMAT), DEMONSTRATORS_FORMAT, str(path))
        return make(header["recipe"], header["report"], load_tensors(data))
    except (OSError, AttributeError, KeyError, TypeError, ValueError, SafetensorError) as error:
        raise UserError(f"{path}: no readable demonstrators ({error}); reinstall the package") from None
