"""Which bags a folder holds: single files, directories, below links, each once; whole and torn told apart."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from edited_bags import LABEL, messages_of, shipped, write_mcap
from msrd_ros.bags.finding import find_bags
from msrd_ros.bags.info import read_info
from msrd_ros.bags.reader import Bag
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.recordings.library import BagLibrary


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for number in (1, 2):
        shutil.copytree(shipped(), tmp_path / "s1" / f"{LABEL}_{number:03d}")
    return tmp_path


def names(folder: Path) -> list[str]:
    return [path.relative_to(folder).as_posix() for path in find_bags(folder)]


def test_links_in_circles_and_twice_count_once(folder: Path) -> None:
    (folder / "latest").symlink_to(folder / "s1")
    (folder / "s1" / "round").symlink_to(folder)
    (folder / "a_bag").symlink_to(folder / "s1" / f"{LABEL}_001")
    (folder / "nowhere").symlink_to(folder / "gone")
    assert names(folder) == [f"s1/{LABEL}_001", f"s1/{LABEL}_002"]
    assert len(BagLibrary.scan(folder, folder / "latest").bags) == 2


def test_links_that_lead_out_are_followed(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "mine").symlink_to(folder / "s1")
    assert names(elsewhere) == [f"mine/{LABEL}_001", f"mine/{LABEL}_002"]
    link = elsewhere / "link"
    link.symlink_to(folder / "s1" / f"{LABEL}_001")
    assert find_bags(link) == [link]


def test_mcap_files_are_bags_where_they_lie(folder: Path) -> None:
    write_mcap(folder / "alone" / "session.mcap", messages_of())
    write_mcap(folder / "many" / "one.mcap", messages_of())
    write_mcap(folder / "many" / "two.mcap", messages_of())
    assert names(folder) == [
        "alone", "many/one.mcap", "many/two.mcap", f"s1/{LABEL}_001", f"s1/{LABEL}_002"
    ]  # fmt: skip
    assert len(BagLibrary.scan(folder / "many" / "one.mcap").bags) == 1


@pytest.mark.parametrize("summary", [True, False])
def test_a_whole_file_is_read_without_metadata(tmp_path: Path, summary: bool) -> None:
    file = write_mcap(tmp_path / "session" / "session.mcap", messages_of(), summary)
    (original,) = read_episodes(Bag(shipped()))
    for path in (file, file.parent):
        (episode,) = read_episodes(Bag(path))
        np.testing.assert_array_equal(episode.observations, original.observations)
        np.testing.assert_array_equal(episode.actions, original.actions)
        assert episode.label == original.label


def test_a_bags_own_file_tells_what_its_directory_tells() -> None:
    file = next(shipped().glob("*.mcap"))
    info, whole = read_info(file), read_info(shipped())
    assert (info.label, info.subject, info.custom_data) == (whole.label, whole.subject, whole.custom_data)
    assert Bag(file).raw() == Bag(shipped()).raw()


def test_parts_of_a_split_recording_are_one_bag(tmp_path: Path) -> None:
    messages = messages_of()
    write_mcap(tmp_path / "long" / "long_0.mcap", messages[:400])
    write_mcap(tmp_path / "long" / "long_1.mcap", messages[400:])
    assert find_bags(tmp_path) == [tmp_path / "long"]
    assert [m.data for m in Bag(tmp_path / "long").raw()] == [m.data for m in messages]


def test_torn_and_foreign_files_are_told_apart(tmp_path: Path) -> None:
    file = write_mcap(tmp_path / "a" / "session.mcap", messages_of())
    whole = file.read_bytes()
    for content, words in (
        (whole[:-5], "was cut off, the end of session.mcap is missing; recover what is there with"),
        (whole[:9], "was cut off"),
        (b"", "is empty"),
        (b"PK\3\4" + whole, "is no MCAP file"),
        (b"version https://git-lfs.github.com/spec/v1\n", "run: git lfs pull"),
    ):
        file.write_bytes(content)
        for path in (file, file.parent):
            with pytest.raises(UserError, match=words):
                read_info(path)


def test_bytes_that_change_anywhere_are_an_error_with_the_bags_name(tmp_path: Path) -> None:
    """Read as it was, or refused in one line that names the bag."""
    file = write_mcap(tmp_path / f"{LABEL}_001.mcap", messages_of()[:200])
    whole = file.read_bytes()
    rng = np.random.default_rng(7)
    refused: list[str] = []
    for _ in range(150):
        data = bytearray(whole)
        for place in rng.integers(0, len(whole), 4):
            data[place] = rng.integers(0, 256)
        file.write_bytes(data)
        try:
            Bag(file).raw()
        except UserError as error:
            refused.append(str(error))
    assert len(refused) > 100
    assert [line for line in refused if str(file) not in line or "\n" in line] == []
