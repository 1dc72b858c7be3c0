"""What a node waits for is said when it changes, and again after ever longer pauses."""

from __future__ import annotations

from msrd_ros.nodes.waiting import LONGEST_PAUSE_S, Waiting


class Diary:
    """A clock that is set by hand, and the lines that were said."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.lines: list[str] = []
        self.waiting = Waiting(self.lines.append, lambda: self.now_s)

    def live(self, seconds: int, *reasons: str) -> list[float]:
        """Update once a second; after how many seconds something was said."""
        said = []
        for second in range(seconds):
            before = len(self.lines)
            self.waiting.update(reasons)
            if len(self.lines) > before:
                said.append(float(second))
            self.now_s += 1.0
        return said


def test_it_is_said_at_once_then_after_ever_longer_pauses() -> None:
    diary = Diary()
    assert diary.live(100, "joints", "ball") == [0, 5, 15, 35, 75]
    assert diary.lines[0] == "waits for joints; ball"
    assert diary.lines[1] == "still waits for joints; ball (5 s)"
    pauses = diary.live(10_000, "joints", "ball")
    assert pauses[-1] - pauses[-2] == LONGEST_PAUSE_S


def test_a_change_is_said_and_each_thing_has_its_own_time() -> None:
    diary = Diary()
    diary.live(10, "joints", "ball")
    assert diary.live(3, "ball", "strategy") == [0]
    assert diary.waiting.figures() == {"waits_for": "ball; strategy", "waits_s": 13.0}
    diary.live(1, "strategy")
    assert diary.waiting.figures() == {"waits_for": "strategy", "waits_s": 4.0}


def test_nothing_is_said_of_nothing_and_the_end_of_waiting_once() -> None:
    diary = Diary()
    assert diary.live(5) == []
    assert diary.waiting.figures() == {}
    diary.live(2, "ball")
    assert diary.live(20) == [0]
    assert diary.lines[-1] == "waits for nothing more"
    assert diary.waiting.figures() == {}
