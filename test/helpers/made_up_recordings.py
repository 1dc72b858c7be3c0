"""Recordings of balls that fly by a known law, in the form of `studies.ball.recordings`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from msrd_ros.studies.ball.law import BallLaw
from msrd_ros.table_tennis.ball.flight import fly
from msrd_ros.table_tennis.ball.rebound import rebound_rigid

COLUMNS = "player_id,rally_id,type,timestamp,ball_pos,ball_vel_out,ball_spin_out"
SPIN_FRAME = Rotation.from_rotvec([-1.5, 0.1, -0.2])
"""From the spins' frame to that of the positions."""
ON_TABLE_M = 0.01


def _words(values: np.ndarray) -> str:
    return f"[{' '.join(f'{value:.8f}' for value in values)}]"


def _late(ball: np.ndarray, law: BallLaw) -> np.ndarray:
    """What is recorded of a ball: its velocity is that of a moment later."""
    later = ball.copy()
    fly(later, law.velocity_lag_s, law.constants())
    return np.concatenate([ball[:3], later[3:]])


def write_events(folder: Path, law: BallLaw, rallies: int = 60, noise_m: float = 0.0) -> None:
    """``match_events.csv`` of three players: shot, bounce, shot in each rally, from both sides."""
    rng, scene = np.random.default_rng(4), law.constants()
    rows = [COLUMNS]
    for rally in range(rallies):
        player, side = f"Player {rally % 3}", 1.0 if rally % 2 else -1.0
        ball = np.zeros(9)
        ball[:3] = -1.6 * side, rng.uniform(-0.5, 0.5), rng.uniform(0.15, 0.4)
        ball[3:6] = side * rng.uniform(4.0, 9.0), rng.normal(0.0, 0.8), rng.uniform(-1.5, 2.0)
        ball[6:] = rng.normal(0.0, 150.0, 3)
        time_s = 10.0 * rally
        states = [("shot_p1", time_s, _late(ball, law))]
        for kind in ("bounce_p2", "shot_p2"):
            duration = 0.12
            if kind.startswith("bounce"):
                probe = ball.copy()
                for duration in np.arange(0.05, 1.0, 0.0005):
                    fly(probe, 0.0005, scene)
                    if probe[2] <= 0.02 and duration > 0.08:
                        break
            fly(ball, duration, scene)
            if kind.startswith("bounce"):
                rebound_rigid(ball, 0.0, 0.0, 1.0, law.restitution, law.friction, scene[0])
            time_s += duration
            states.append((kind, time_s, _late(ball, law)))
        for event, (kind, at, state) in enumerate(states, start=1):
            place = state[:3] + noise_m * rng.standard_normal(3)
            rows.append(
                f"{player},/game_0/rally_{rally}/event{event},{kind},{at:.6f},{_words(place)},"
                f"{_words(state[3:6])},{_words(state[6:])}"
            )
    (folder / "match_events.csv").write_text("\n".join(rows) + "\n")


def write_flights(folder: Path, law: BallLaw, count: int = 24) -> None:
    """A folder ``flights``: balls along -y with one bounce, at 150 Hz."""
    rng, scene = np.random.default_rng(5), law.constants()
    (folder / "flights").mkdir()
    index = ["traj_file,x_spin,y_spin,z_spin"]
    for number in range(1, count + 1):
        ball = np.zeros(9)
        ball[:3] = rng.uniform(-0.4, 0.4), 1.2, rng.uniform(0.2, 0.35)
        ball[3:6] = rng.normal(0.0, 0.4), -rng.uniform(4.0, 7.0), rng.uniform(0.0, 0.6)
        ball[6:] = rng.normal(0.0, 130.0, 3)
        spin = SPIN_FRAME.inv().apply(ball[6:])
        index.append(f"{number},{spin[0]},{spin[1]},{spin[2]}")
        rows, bounced, period = [], False, 1.0 / 1200.0
        for tick in range(600):
            if tick % 8 == 0:
                x, y, z = ball[:3] + 0.0005 * rng.standard_normal(3)
                rows.append(f"{tick * period:.4f};{x:.5f};{y:.5f};{z:.5f}")
            fly(ball, period, scene)
            if ball[2] < ON_TABLE_M and not bounced:
                rebound_rigid(ball, 0.0, 0.0, 1.0, law.restitution, law.friction, scene[0])
                bounced = True
            if ball[1] < -1.3:
                break
        (folder / "flights" / f"{number:03d}.csv").write_text("\n".join(rows) + "\n")
    (folder / "flights" / "index.csv").write_text("\n".join(index) + "\n")
