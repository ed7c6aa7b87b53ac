"""Missions that are recorded for tests."""

import math
from pathlib import Path

import numpy as np

from cinegen import Mechanism
from cinegen.mission import MissionRecorder, Recording, RobotSample
from cinegen.model import ForwardKinematics


def record(path: Path, mechanism: Mechanism, times, q, name: str = "robot") -> Recording:
    """A recording of configurations."""
    with MissionRecorder(path, {name: mechanism}, overwrite=True) as recorder:
        for time, q_now in zip(times, q, strict=True):
            recorder.write(time, {name: RobotSample(np.asarray(q_now), "IDLE")})
    assert recorder.lost == 0
    return Recording.load(path)


def swung(mechanism: Mechanism, seconds: float = 2.0, rate: float = 100.0, part: float = 0.25, seed: int = 0):
    """Times and configurations of all motors swinging about home, inside their limits, on home's branch."""
    model, rng = mechanism.model, np.random.default_rng(seed)
    forward = ForwardKinematics(mechanism)
    times = np.arange(round(seconds * rate) + 1) / rate
    swings = {}
    for joint in mechanism.actuated:
        i, column = mechanism.q_index(joint), mechanism.v_index(joint)
        home = mechanism.q_home[i]
        room = min(model.upperPositionLimit[i] - home, home - model.lowerPositionLimit[i], mechanism.scale[column])
        swings[joint] = home, part * room * rng.uniform(0.3, 1.0), rng.uniform(0.5, 1.5)
    q = []
    for time in times:
        phase = 2.0 * math.pi * time / seconds
        q.append(forward.move({joint: home + size * math.sin(f * phase) for joint, (home, size, f) in swings.items()}))
    return times, np.array(q)
