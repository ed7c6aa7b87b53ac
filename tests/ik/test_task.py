"""A task's equations: what is left to do, and its derivative."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from cinegen.ik import FrameTask


def _body_step(placement, twist):
    """The placement after a small motion given in the node's own axes."""
    rotated = placement.rotation @ pin.exp3(twist[3:])
    return pin.SE3(rotated, placement.translation + placement.rotation @ twist[:3])


@pytest.mark.parametrize("translation", range(4))
@pytest.mark.parametrize("rotation", range(4))
def test_the_rows_are_what_a_motion_takes_off_the_error_near_the_target(translation, rotation):
    rng = np.random.default_rng(translation + 4 * rotation)
    target = pin.SE3.Random()
    task = FrameTask("node", target, translation, rotation)
    near = _body_step(target, rng.normal(0, 1e-3, 6))
    error, rows = task.equations(near, np.eye(6))
    assert error.shape == (task.rows,)
    for i in range(6):
        e = np.zeros(6)
        e[i] = 1e-6
        ahead = task.equations(_body_step(near, e), np.eye(6))[0]
        behind = task.equations(_body_step(near, -e), np.eye(6))[0]
        assert (behind - ahead) / 2e-6 == pytest.approx(rows[:, i], abs=6e-3)


@pytest.mark.parametrize(
    ("translation", "rotation", "free"),
    [
        (3, 0, [0, 0, 0, 0.3, -0.4, 0.5]),
        (0, 3, [0.3, -0.4, 0.5, 0, 0, 0]),
        (2, 3, [0, 0, 0.7, 0, 0, 0]),
        (1, 0, [0, 0.2, 0.7, 0.1, 0.2, 0.3]),
        (3, 2, [0, 0, 0, 0, 0, 2.5]),
        (3, 1, [0, 0, 0, 0.3, 0.4, 0]),
    ],
)
def test_what_a_pull_does_not_hold_is_no_error(translation, rotation, free):
    target = pin.SE3.Random()
    error, _ = FrameTask("node", target, translation, rotation).equations(_body_step(target, np.array(free)), np.eye(6))
    assert error == pytest.approx(np.zeros(translation + rotation), abs=1e-12)


def test_what_can_not_be_followed_is_known():
    bad = pin.SE3.Identity()
    bad.translation = np.array([np.nan, 0.0, 0.0])
    good = pin.SE3.Identity()
    assert FrameTask("node", good).is_valid()
    for wrong in (
        FrameTask("node", bad),
        FrameTask("node", np.eye(4)),
        FrameTask("node", None),
        FrameTask("node", good, translation=7),
        FrameTask("node", good, rotation=-1),
        FrameTask("node", good, rotation="all"),
        FrameTask("node", good, weight=float("inf")),
        FrameTask("node", good, weight=0.0),
        FrameTask("node", good, weight="heavy"),
    ):
        assert not wrong.is_valid()
