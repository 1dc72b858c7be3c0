"""Bags are relabelled, trimmed, flagged, discarded, and all of it can be taken back to the last byte."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from edited_bags import LABEL, edited, messages_of, write, write_mcap
from libraries import contents, copy_of, write_split
from msrd_ros.bags.cdr import read_frame_id
from msrd_ros.bags.info import read_info
from msrd_ros.bags.reader import Bag
from msrd_ros.bags.schemas import serialise
from msrd_ros.bags.writer import set_aside, write_bag
from msrd_ros.contract.labels import FRAME_NAMES, UNLABELLED
from msrd_ros.contract.topics import BagMessage, BagTopic
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.curation import Curation
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.recordings.library import BagLibrary
from synthetic_strokes import at_root, header, make, stroke_messages, topics_of

BAG = f"subject_01/{LABEL}_001"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return copy_of("subject_01", f"{LABEL}_001", f"{LABEL}_002", target=tmp_path / "bags")


# -- relabel ------------------------------------------------------------------------------------------------


def test_a_relabelled_bag_reads_as_the_new_label_and_is_else_the_same(folder: Path) -> None:
    before = Bag(folder / BAG)
    old, facts = before.raw(), dict(before.info.custom_data)
    edit = Curation(folder).relabel(folder / BAG, "my-smash")
    assert (edit.bag, edit.to) == (BAG, "subject_01/my-smash_001")
    after = Bag(folder / edit.to)
    new = after.raw()
    assert after.labels(new) == {"my-smash"}
    assert [episode.label for episode in read_episodes(after)] == ["my-smash"]
    assert after.info.custom_data == {**facts, "label": "my-smash"}
    assert [message._replace(data=b"") for message in new] == [message._replace(data=b"") for message in old]
    for one, other in zip(old, new, strict=True):
        role = after.role(one.topic)
        if role in ("joint_states", "strategy", "rally/outcome") and read_frame_id(one.data) == LABEL:
            assert read_frame_id(other.data) == "my-smash"
            assert len(one.data) != len(other.data) or one.data != other.data
        else:
            assert one.data == other.data
    assert not (folder / BAG).exists()
    assert [bag.path.name for bag in BagLibrary.scan(folder).bags] == [f"{LABEL}_002", "my-smash_001"]


def test_a_label_is_taken_away_and_another_given(folder: Path) -> None:
    before = contents(folder)
    (first,) = read_episodes(Bag(folder / BAG))
    curation = Curation(folder)
    bare = curation.relabel(folder / BAG, "")
    assert bare.to == "subject_01/unlabelled_001"
    assert str(bare).endswith("now subject_01/unlabelled_001: label forehand-push -> unlabelled")
    bag = Bag(folder / bare.to)
    assert (bag.info.unlabelled, bag.info.custom_data["label"], bag.labels(bag.raw())) == (True, "", set())
    assert not {read_frame_id(m.data) for m in bag.raw() if m.topic in ("/joint_states", "/strategy")} - {""}
    with pytest.raises(UserError, match="is unlabelled already"):
        curation.relabel(folder / bare.to, "unlabelled")
    other = curation.relabel(folder / f"subject_01/{LABEL}_002", "unlabelled")
    assert other.to == "subject_01/unlabelled_002"

    smash = curation.relabel(folder / bare.to, "my-smash")
    assert smash.to == "subject_01/my-smash_001"
    bag = Bag(folder / smash.to)
    assert (bag.info.label, bag.labels(bag.raw())) == ("my-smash", {"my-smash"})
    (episode,) = read_episodes(bag)
    assert episode.label == "my-smash"
    np.testing.assert_array_equal(episode.observations, first.observations)
    for edit in (smash, other, bare):
        curation.restore(folder / edit.to)
    assert contents(folder) == before


def test_a_label_travels_on_commands_and_verdicts_too_and_frames_of_drivers_stay(tmp_path: Path) -> None:
    messages = at_root(stroke_messages(LABEL, joint_frame="base_link"), prefix="/lab")
    command = make("trajectory_msgs/msg/JointTrajectory", header(messages[0].log_time_ns, LABEL), [], [])
    kind = "trajectory_msgs/msg/JointTrajectory"
    first = messages[0]
    messages.insert(1, first._replace(topic="/lab/joint_command", data=serialise(command, kind)))
    topics = [*topics_of(stroke_messages(LABEL), prefix="/lab"), BagTopic("/lab/joint_command", kind)]
    write_bag(tmp_path / "session", topics, messages, {})
    edit = Curation(tmp_path).relabel(tmp_path / "session", "my-smash")
    assert edit.to == "session"
    said: dict[str, set[str]] = {}
    for message in Bag(tmp_path / "session").raw():
        said.setdefault(message.topic, set()).add(read_frame_id(message.data))
    assert said["/lab/joint_command"] == said["/lab/strategy"] == said["/lab/rally/outcome"] == {"my-smash"}
    assert said["/lab/joint_states"] == {"base_link"}
    assert said["/lab/feed"] == {"world"}


LABELS = st.from_regex(r"[a-z0-9-]{1,64}", fullmatch=True).filter(
    lambda text: text not in {*FRAME_NAMES, UNLABELLED, LABEL}
)


@settings(max_examples=15)
@given(label=LABELS)
def test_any_relabel_and_restore_is_the_same_to_the_last_byte(
    tmp_path_factory: pytest.TempPathFactory, label: str
) -> None:
    folder = copy_of("subject_01", f"{LABEL}_001", target=tmp_path_factory.mktemp("bags"))
    before = contents(folder)
    curation = Curation(folder)
    edit = curation.relabel(folder / BAG, label)
    assert Bag(folder / edit.to).info.label == label
    curation.restore(folder / edit.to)
    assert contents(folder) == before
    assert (folder / ".discarded" / curation.edits()[-1].id / edit.to).is_dir(), "the new version is kept"


@pytest.mark.parametrize(
    ("label", "reason"), [("My Smash", "no strategy label"), ("world", "frame's name"), (LABEL, "already")]
)
def test_no_label_and_its_own_label_are_refused(folder: Path, label: str, reason: str) -> None:
    before = contents(folder)
    with pytest.raises(UserError, match=reason):
        Curation(folder).relabel(folder / BAG, label)
    assert contents(folder) == before


def test_the_next_number_of_the_new_label_is_taken(folder: Path) -> None:
    curation = Curation(folder)
    assert curation.relabel(folder / BAG, "my-smash").to == "subject_01/my-smash_001"
    assert (
        curation.relabel(folder / "subject_01" / f"{LABEL}_002", "my-smash").to == "subject_01/my-smash_002"
    )


# -- trim ---------------------------------------------------------------------------------------------------


def test_a_trimmed_bag_is_the_same_stroke_with_less_before_it(folder: Path) -> None:
    old = Bag(folder / BAG).raw()
    curation = Curation(folder)
    curation.trim(folder / BAG, 0.1, 2.2)
    bag = Bag(folder / BAG)
    new = bag.raw()
    begin_ns = old[0].log_time_ns + 100_000_000
    assert new[0].log_time_ns == begin_ns
    still_count = ("strategy", "robot_description", "/tf_static", "feed")
    told = [message for message in old if bag.role(message.topic) in still_count]
    kept = [message.data for message in old if message.log_time_ns >= begin_ns or message in told]
    assert sorted(message.data for message in new) == sorted(kept)
    (after,) = read_episodes(bag)
    curation.restore(folder / BAG)
    (before,) = read_episodes(Bag(folder / BAG))
    assert (after.observations == before.observations).all()


@pytest.mark.parametrize(
    ("begin_s", "end_s", "reason"),
    [
        (0.0, 1.9, "rally/outcome would be cut off"),
        (0.6, 2.2, "would be no stroke: launch_missed"),
        (0.5, 0.5, "no stretch"),
        (-0.1, 1.0, "no stretch"),
        (float("nan"), 1.0, "no stretch"),
        (0.0, 9.0, "2.148 s long"),
        (3.0, 9.0, "2.148 s long"),
    ],
)
def test_what_would_be_no_stroke_is_not_cut(folder: Path, begin_s: float, end_s: float, reason: str) -> None:
    before = contents(folder)
    with pytest.raises(UserError, match=reason) as refused:
        Curation(folder).trim(folder / BAG, begin_s, end_s)
    assert ".discarded" not in str(refused.value)
    assert contents(folder) == before
    assert not list((folder / ".discarded").glob("edit-*")), "what nobody wants does not stay"


# -- discard and restore ------------------------------------------------------------------------------------


def test_a_discarded_bag_is_read_by_nobody_and_comes_back_to_the_last_byte(folder: Path) -> None:
    before = contents(folder)
    curation = Curation(folder)
    edit = curation.discard(folder / BAG)
    assert [bag.path.name for bag in BagLibrary.scan(folder).bags] == [f"{LABEL}_002"]
    assert curation.discarded() == {edit.to: BAG}
    Curation.of(folder / BAG).restore(folder / BAG)
    assert contents(folder) == before
    assert curation.discarded() == {}
    with pytest.raises(UserError, match="nothing to take back"):
        curation.restore(folder / BAG)


def test_edits_are_taken_back_last_first(folder: Path) -> None:
    before = contents(folder)
    curation = Curation(folder)
    first = curation.relabel(folder / BAG, "my-smash")
    curation.trim(folder / first.to, 0.1, 2.2)
    curation.discard(folder / first.to)
    with pytest.raises(UserError, match="edit-3 came after it; restore that first"):
        curation.restore(folder / first.id)
    for _ in range(2):
        curation.restore(folder / first.to)
    assert (folder / first.to).is_dir()
    curation.restore(folder / BAG)
    assert contents(folder) == before


def test_a_name_that_is_taken_meanwhile_is_refused_and_nothing_moves(folder: Path) -> None:
    curation = Curation(folder)
    curation.discard(folder / BAG)
    shutil.copytree(folder / "subject_01" / f"{LABEL}_002", folder / BAG)
    before = contents(folder)
    with pytest.raises(UserError, match="something else has this name by now; relabel, rename or discard it"):
        curation.restore(folder / "edit-1")
    assert contents(folder) == before
    curation.discard(folder / BAG)
    assert len(curation.discarded()) == 2
    curation.restore(folder / "edit-1")
    assert len(curation.discarded()) == 1


def test_what_the_recorder_discards_is_there_and_comes_back(folder: Path) -> None:
    before = contents(folder)
    set_aside(folder, folder / BAG)
    curation = Curation(folder)
    assert curation.discarded() == {f".discarded/{BAG}": BAG}
    curation.restore(folder / BAG)
    assert contents(folder) == before


def test_a_bag_that_cannot_be_read_can_be_discarded(folder: Path) -> None:
    (folder / BAG / "metadata.yaml").write_text("nonsense", encoding="utf-8")
    curation = Curation(folder)
    with pytest.raises(UserError, match="not readable"):
        curation.relabel(folder / BAG, "my-smash")
    curation.discard(folder / BAG)
    assert BagLibrary.scan(folder, strict=True).bags


# -- flags --------------------------------------------------------------------------------------------------


def test_flags_follow_the_bag_and_leave_its_bytes(folder: Path) -> None:
    before = contents(folder)
    curation = Curation(folder)
    curation.flag(folder / BAG, "look again")
    curation.flag(folder / BAG, "late")
    assert contents(folder) == before
    edit = curation.relabel(folder / BAG, "my-smash")
    assert curation.flags() == {edit.to: ("look again", "late")}
    curation.unflag(folder / edit.to, "late")
    aside = curation.discard(folder / edit.to)
    shutil.copytree(folder / aside.to, folder / edit.to)
    assert curation.flags() == {aside.to: ("look again",)}, "another bag of this name has none"
    shutil.rmtree(folder / edit.to)
    curation.restore(folder / edit.to)
    curation.restore(folder / edit.to)
    assert curation.flags() == {BAG: ("look again",)}
    curation.unflag(folder / BAG)
    assert curation.flags() == {}


def test_flags_that_say_nothing_or_are_not_there_are_refused(folder: Path) -> None:
    curation = Curation(folder)
    for text in ("", "  ", "two\nlines"):
        with pytest.raises(UserError, match="no note"):
            curation.flag(folder / BAG, text)
    curation.flag(folder / BAG, "late")
    with pytest.raises(UserError, match="already"):
        curation.flag(folder / BAG, "late")
    with pytest.raises(UserError, match="it has 'late'"):
        curation.unflag(folder / BAG, "early")


# -- whose bags ---------------------------------------------------------------------------------------------


def test_a_folder_without_such_a_bag_is_left_alone(tmp_path: Path, folder: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "link").symlink_to(folder / BAG)
    for path, reason in (
        (tmp_path / "gone", "does not exist"),
        (tmp_path / "empty", "is no bag"),
        (tmp_path / "link", "is a link to"),
        (folder / BAG / f"{LABEL}_001_0.mcap", "is a file of the bag"),
    ):
        with pytest.raises(UserError, match=reason):
            Curation.of(path).discard(path)
    assert not list(tmp_path.rglob(".discarded"))


def test_the_folder_of_a_bag_is_that_above_its_subject_or_the_one_edited_before(
    tmp_path: Path, folder: Path
) -> None:
    assert Curation.of(folder / BAG).folder == folder
    write_mcap(tmp_path / "others" / "day_1" / "session.mcap", messages_of())
    session = tmp_path / "others" / "day_1" / "session.mcap"
    assert Curation.of(session).folder == tmp_path / "others" / "day_1"
    (tmp_path / "others" / ".discarded").mkdir()
    assert Curation.of(session).folder == tmp_path / "others"


def test_a_file_without_metadata_is_flagged_discarded_and_restored(
    tmp_path: Path,
) -> None:
    for name in ("one", "two", "three"):
        write_mcap(tmp_path / f"{name}.mcap", messages_of())
    before = contents(tmp_path)
    curation = Curation(tmp_path)
    to_do = r"make one of it with: python -m msrd_ros\.bags repair"
    with pytest.raises(UserError, match=to_do):
        curation.relabel(tmp_path / "one.mcap", "my-smash")
    with pytest.raises(UserError, match=to_do):
        curation.trim(tmp_path / "one.mcap", 0.1, 2.2)
    curation.flag(tmp_path / "one.mcap", "late")
    curation.discard(tmp_path / "one.mcap")
    assert [bag.path.name for bag in BagLibrary.scan(tmp_path).bags] == ["three.mcap", "two.mcap"]
    curation.restore(tmp_path / "one.mcap")
    assert contents(tmp_path) == before


def test_a_split_bag_of_others_is_relabelled_and_restored(tmp_path: Path) -> None:
    messages = stroke_messages(LABEL)
    path = write_split(tmp_path / "session", topics_of(messages), at_root(messages))
    before = contents(tmp_path)
    curation = Curation(tmp_path)
    curation.relabel(path, "my-smash")
    assert read_info(path).label == "my-smash"
    assert [episode.label for episode in read_episodes(Bag(path))] == ["my-smash"]
    curation.restore(path)
    assert contents(tmp_path) == before


def test_a_bag_of_several_strategies_is_not_relabelled(tmp_path: Path) -> None:
    def other(message: BagMessage) -> BagMessage:
        return message._replace(log_time_ns=message.log_time_ns + 5_000_000_000)

    first = messages_of()

    def renamed(message: object, _: int) -> object:
        getattr(message, "header", message).frame_id = "my-smash"  # type: ignore[attr-defined]
        return message

    second = edited(map(other, first), {"strategy": renamed, "rally/outcome": renamed})
    path = write(tmp_path / "session", [*first, *second])
    with pytest.raises(UserError, match=rf"shows several strategies \({LABEL}, my-smash\)"):
        Curation(tmp_path).relabel(path, "third")
