"""What courses are compared by."""

from __future__ import annotations

import numpy as np

from msrd_ros.learning.newcomers.frame import PHASES, course_of, shrunk_covariance


def test_a_course_is_the_mean_of_each_phase_whatever_the_length() -> None:
    steps = np.arange(1.0, 17.0)
    seen = np.concatenate([[99.0], steps])[:, None]
    assert course_of([seen]).tolist() == [1.5, 3.5, 5.5, 7.5, 9.5, 11.5, 13.5, 15.5]
    longer = np.concatenate([[99.0], np.repeat(steps, 3)])[:, None]
    assert np.allclose(course_of([seen, longer]), course_of([seen]))
    assert len(course_of([np.zeros((30, 3))])) == 3 * PHASES


def test_covariances_are_drawn_to_the_identity_by_as_much_as_they_are_uncertain() -> None:
    rng = np.random.default_rng(5)
    truth = np.diag([4.0, 1.0, 0.25])
    rows = rng.standard_normal((4000, 3)) @ np.sqrt(truth)
    assert np.allclose(shrunk_covariance(rows), truth, atol=0.3)
    few = shrunk_covariance(rows[:3])
    assert np.linalg.eigvalsh(few).min() > 0.05
    assert np.array_equal(shrunk_covariance(rows[:0]), np.eye(3))
