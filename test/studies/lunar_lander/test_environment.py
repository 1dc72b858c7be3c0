"""The endless lander: its truth behind the end, and FLAIR's demonstrations rightly paired."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("Box2D")

from gymnasium.envs.box2d.lunar_lander import heuristic

from msrd_ros.core.errors import UserError
from msrd_ros.learning.demonstration_sets import demonstrations_from_arrays
from msrd_ros.learning.examples.lunar_lander import OBSERVATION_NAMES
from msrd_ros.studies.lunar_lander.demonstrations import SHIPPED, load_demonstrations
from msrd_ros.studies.lunar_lander.environment import LOST, RESTING, make_lander, shaping_potential


def fall(steps: int) -> tuple[np.ndarray, np.ndarray]:
    """States and rewards of a lander that never fires its engines."""
    lander = make_lander()
    states, rewards = [lander.reset(seed=3)[0]], []
    for _ in range(steps):
        seen, reward, terminated, truncated, _ = lander.step(np.zeros(2, dtype=np.float32))
        assert not terminated
        assert not truncated
        states.append(seen)
        rewards.append(float(reward))
    return np.array(states), np.array(rewards)


def test_a_crash_is_paid_for_to_the_end_also_when_the_wreck_is_at_rest() -> None:
    states, rewards = fall(500)
    crash = int(np.argmax(rewards == LOST))
    assert 40 < crash < 200
    assert np.all(states[-1] == states[-50])
    assert np.all(rewards[crash:] == LOST)
    assert np.abs(rewards[:crash]).max() < 50.0


def test_a_lander_that_landed_is_at_rest_to_the_end() -> None:
    lander = make_lander()
    seen, _ = lander.reset(seed=3)
    paid = []
    for _ in range(500):
        standing = seen[6] > 0.0 and seen[7] > 0.0
        action = np.array([-1.0, 0.0]) if standing else heuristic(lander.unwrapped, seen)  # type: ignore[no-untyped-call]
        seen, reward, *_ = lander.step(np.asarray(action, dtype=np.float32))
        paid.append(float(reward))
    rest = paid.index(RESTING)
    assert 100 < rest < 400
    assert set(paid[rest:]) == {RESTING}
    assert LOST not in paid


def test_a_step_in_the_air_pays_the_change_of_the_potential() -> None:
    states, rewards = fall(30)
    # The engines are off, so that there is no price of fuel; the first step has nothing to compare with.
    np.testing.assert_allclose(np.diff(shaping_potential(states))[1:], rewards[1:], atol=1e-3)


def test_out_of_bounds_is_lost_and_goes_on() -> None:
    lander = make_lander()
    lander.reset(seed=3)
    paid = []
    for _ in range(400):
        seen, reward, *_ = lander.step(np.array([1.0, 0.6], dtype=np.float32))
        paid.append((abs(float(seen[0])) >= 1.0, float(reward)))
    outside = [reward for out, reward in paid if out]
    assert len(outside) > 10
    assert set(outside) == {LOST}


def test_shipped_demonstrations_are_paired_with_the_state_before_the_action(
    recwarn: pytest.WarningsRecorder,
) -> None:
    source = load_demonstrations()
    data = source.demonstrate(3)
    assert not recwarn.list  # of actions that stand beside other observations than their own
    assert data.observations.shape == (10, 3, 500, 8)
    assert data.actions.shape == (10, 3, 499, 2)
    np.testing.assert_array_equal(data.actions[4, 2, 7], source.actions[4, 2, 8])
    np.testing.assert_array_equal(data.observations[4, 2, 7], source.observations[4, 2, 7])
    assert data.layout.observation_names == OBSERVATION_NAMES
    assert data.step_counts().min() == 499


def test_paired_as_they_lie_they_would_be_warned_of() -> None:
    source = load_demonstrations()
    rows = [(i, m) for i in range(10) for m in range(3)]
    with pytest.warns(UserWarning, match="drop the first action"):
        demonstrations_from_arrays(
            [source.observations[row] for row in rows],
            [source.actions[row][:-1] for row in rows],
            [str(row[0]) for row in rows],
            terminated=False,
        )


def test_the_same_action_from_the_same_state_leads_where_the_demonstration_went() -> None:
    """Box2D's own step is hidden, but fuel-free flight is Newton's: the row after the action has moved."""
    data = load_demonstrations().demonstrate(3)
    states = data.observations.reshape(30, 500, 8)
    free = (data.actions.reshape(30, 499, 2)[..., 0] <= 0.0) & (
        np.abs(data.actions.reshape(30, 499, 2)[..., 1]) < 0.5
    )
    flying = free & (states[:, :-1, 6:].sum(axis=-1) == 0.0) & (states[:, 1:, 6:].sum(axis=-1) == 0.0)
    gained = np.diff(states[..., 3], axis=1)[flying]
    assert flying.sum() > 500
    # -10 m/s2 over a fiftieth of a second, in the units of the observation.
    assert np.quantile(np.abs(gained - np.median(gained)), 0.9) < 2e-3
    assert np.median(gained) == pytest.approx(-0.0266, abs=5e-4)


@pytest.mark.parametrize(
    ("arrays", "said"),
    [
        (None, "cannot be read"),
        ({"observations": np.zeros((2, 3, 5, 8))}, "actions"),
        ({"observations": np.zeros((2, 3, 5, 7)), "actions": np.zeros((2, 3, 5, 2))}, "expected"),
        ({"observations": np.zeros((3, 5, 8)), "actions": np.zeros((3, 5, 2))}, "expected"),
        ({"observations": np.zeros((2, 3, 5, 8)), "actions": np.zeros((2, 3, 4, 2))}, "expected"),
    ],
)
def test_another_file_is_refused_by_name(
    tmp_path: Path, arrays: dict[str, np.ndarray] | None, said: str
) -> None:
    path = tmp_path / "mine.npz"
    if arrays is not None:
        np.savez(path, allow_pickle=False, **arrays)
    with pytest.raises(UserError, match=rf"mine\.npz.*{said}"):
        load_demonstrations(path)


def test_damaged_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "damaged.npz"
    path.write_bytes(SHIPPED.read_bytes()[:1000])
    with pytest.raises(UserError, match=r"damaged\.npz"):
        load_demonstrations(path)
