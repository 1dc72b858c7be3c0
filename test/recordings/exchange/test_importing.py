"""Bag to data set to bag loses nothing, and a data set that was changed is not taken for its bags."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet as parquet
import pytest

from exchanged_bags import DAMAGED, GOOD, LONE, LONG, REFUSED, STROKES, Exported, without_bags
from libraries import contents
from msrd_ros.bags.reader import Bag
from msrd_ros.contract.columns import DataContract
from msrd_ros.contract.labels import say_label
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.recordings.exchange.importing import import_bags, import_columns
from msrd_ros.recordings.exchange.kinds import KINDS
from sawyer import ROBOT

DATA = Path("data", "chunk-000", "file-000.parquet")
TWICE = "forehand-push"
"""Its stroke is in a bag and in a lone file."""
EXACT = {"lerobot": 1e-4, "minari": 0.0}
"""Of arrays made of a data set's rows: the ball's speed is of differences of what is in single precision."""
INDEX = Path("msrd_ros", "bags.json")


@pytest.fixture
def copy(exported: Exported, tmp_path: Path) -> Path:
    """A LeRobot data set to change."""
    return Path(shutil.copytree(exported["lerobot"][0], tmp_path / "copy"))


@pytest.mark.parametrize("kind", KINDS)
def test_all_bags_come_back_byte_for_byte(kind: str, bags: Path, exported: Exported, tmp_path: Path) -> None:
    data_set, done = exported[kind]
    assert len(done.strokes) == STROKES
    assert set(done.bags) == {*GOOD, REFUSED, DAMAGED, LONE, LONG}
    assert done.refused.keys() == {REFUSED, DAMAGED}
    assert "is the joint frozen?" in done.refused[REFUSED]
    assert import_bags(data_set, tmp_path / "back", kind, ROBOT.folder).bags == len(done.bags)
    assert contents(tmp_path / "back") == contents(bags)


@pytest.mark.parametrize("kind", KINDS)
def test_the_contract_beside_a_data_set_is_a_mapping_of_it(
    kind: str, exported: Exported, tmp_path: Path
) -> None:
    data_set, done = exported[kind]
    mapping = data_set / "msrd_ros" / "contract.yaml"
    assert DataContract.read(mapping) == KINDS[kind].contract(ROBOT)
    bare = without_bags(data_set, tmp_path / "bare")
    # A single file does not say who showed its stroke.
    text = mapping.read_text(encoding="utf-8") + "subject: somebody\n"
    (tmp_path / "mapping.yaml").write_text(text, encoding="utf-8")
    imported = import_columns(bare, tmp_path / "made", kind, tmp_path / "mapping.yaml")
    assert (imported.bags, imported.refused) == (STROKES, ())
    for stroke in done.strokes:
        episode = stroke.episode
        label = say_label(episode.label)
        made = [
            one
            for path in sorted((tmp_path / "made" / "somebody").glob(f"{label}_*"))
            for one in read_episodes(Bag(path))
            if one.start_ns == episode.start_ns
        ]
        assert len(made) == 1 + (label == TWICE)
        count = len(episode.actions)
        for name, rows in (("observations", count), ("actions", count - 1)):
            found, expected = getattr(made[0], name)[:rows], getattr(episode, name)[:rows]
            np.testing.assert_allclose(found, expected, 0.0, EXACT[kind], err_msg=name)


def test_a_data_set_that_was_changed_is_not_taken_for_its_bags(copy: Path, tmp_path: Path) -> None:
    table = parquet.read_table(copy / DATA)
    actions = [list(row) for row in table["action"].to_pylist()]
    actions[40][2] += 0.5
    column = table.schema.get_field_index("action")
    field = table.schema.field(column)
    changed = pyarrow.array(actions, field.type)
    parquet.write_table(table.set_column(column, field, changed), copy / DATA)
    with pytest.raises(UserError, match=r"episode 0: action is not what the bag .*--mapping .*contract.yaml"):
        import_bags(copy, tmp_path / "back", "lerobot")
    assert not (tmp_path / "back").exists()


def test_episodes_that_were_taken_out_are_missed(copy: Path, tmp_path: Path) -> None:
    file = copy / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    parquet.write_table(parquet.read_table(file).slice(1), file)
    with pytest.raises(
        UserError, match=r"4 episodes are not the 5 strokes of the bags beside it; .*--mapping"
    ):
        import_bags(copy, tmp_path / "back", "lerobot")


def test_a_bag_that_was_changed_is_refused(copy: Path, tmp_path: Path) -> None:
    file = next((copy / "msrd_ros" / "bags" / GOOD[0]).glob("*.mcap"))
    file.write_bytes(file.read_bytes()[:-1])
    with pytest.raises(UserError, match=rf"the bag {GOOD[0]} beside it was changed|is not what the bag"):
        import_bags(copy, tmp_path / "back", "lerobot")
    refused = copy / "msrd_ros" / "bags" / REFUSED / "metadata.yaml"
    shutil.copy(next((copy.parent).rglob("tasks.parquet")), refused)
    with pytest.raises(UserError, match="was changed"):
        import_bags(copy, tmp_path / "back", "lerobot")


@pytest.mark.parametrize(
    ("change", "blame"),
    [
        ({"format": 2}, "is of format 2, .* upgrade"),
        ({"robot": "ur10e@123"}, "ur10e"),
        (
            {"bags": [{"path": "../../x", "files": {}, "strokes": 0, "refused": ""}]},
            "leads out of the folder",
        ),
        (
            {"bags": [{"path": "x", "files": {"../y": ""}, "strokes": 0, "refused": ""}]},
            "leads out of the folder",
        ),
        ({"bags": None}, "bags.json: is not readable"),
    ],
)
def test_what_lies_beside_is_checked(
    copy: Path, tmp_path: Path, change: dict[str, object], blame: str
) -> None:
    told = json.loads((copy / INDEX).read_text(encoding="utf-8"))
    (copy / INDEX).write_text(json.dumps({**told, **change}), encoding="utf-8")
    with pytest.raises(UserError, match=blame):
        import_bags(copy, tmp_path / "back", "lerobot")


def test_without_bags_a_mapping_is_asked_for(copy: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"no bags are kept beside it .*--mapping"):
        import_bags(without_bags(copy, tmp_path / "bare"), tmp_path / "back", "lerobot")
