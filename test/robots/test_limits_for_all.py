"""Motion limits for all joints, wishes and periods: never beyond one, and always able to stop."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from msrd_ros.robots.limits import next_velocity

ROUNDING = 1e-9
LAST_STEP = 1.0 / 8.0
"""The last braking step takes a whole period: up to a T^2 / 8 further than braking without steps."""

JOINTS = st.tuples(
    st.floats(-4.0, 3.0),  # lowest position, rad
    st.floats(0.2, 8.0),  # range, rad
    st.floats(0.1, 10.0),  # speed limit, rad/s
    st.floats(0.5, 100.0),  # acceleration limit, rad/s^2
)
WISHES = st.lists(st.tuples(st.floats(allow_nan=False), st.integers(1, 60)), min_size=1, max_size=8)


@given(joint=JOINTS, place=st.floats(0.0, 1.0), wishes=WISHES, period_s=st.floats(0.0005, 0.02))
def test_no_wish_leads_beyond_a_limit_and_the_joint_can_stop(
    joint: tuple[float, float, float, float], place: float, wishes: list[tuple[float, int]], period_s: float
) -> None:
    lower, width, speed, acceleration = joint
    upper = lower + width
    over = LAST_STEP * acceleration * period_s**2 + ROUNDING
    position, velocity = lower + place * width, 0.0
    # Whatever was wanted, in the end the joint is told to stop.
    stop = (0.0, int(speed / (acceleration * period_s)) + 2)
    for wanted, periods in [*wishes, stop]:
        for _ in range(periods):
            after = next_velocity(position, velocity, wanted, lower, upper, speed, acceleration, period_s)
            assert abs(after) <= speed + ROUNDING
            assert abs(after - velocity) <= acceleration * period_s + ROUNDING
            position += 0.5 * (velocity + after) * period_s
            velocity = after
            assert lower - over <= position <= upper + over
    assert abs(velocity) <= ROUNDING
