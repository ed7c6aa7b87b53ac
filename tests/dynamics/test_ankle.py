"""The parallel ankle: actuator forces against the closed form of its leg lengths."""

import numpy as np
import pytest

import cinegen

# From the file's numbers: on the shank and on the foot, about the ankle, with the shank's axes at home (m).
SIDE = 0.08 * np.array([np.cos(np.radians(145.0)), np.sin(np.radians(145.0))])
SHANK = np.array([[SIDE[0], SIDE[1], 0.28], [SIDE[0], -SIDE[1], 0.28]])
FOOT = np.array([[-0.07, 0.045, -0.015], [-0.07, -0.045, -0.015]])


def rotations(pitch, roll):
    """About the shank's y, then the foot's x; and their derivatives."""
    (c, s), (k, w) = ((np.cos(angle), np.sin(angle)) for angle in (pitch, roll))
    y, x = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]), np.array([[1, 0, 0], [0, k, -w], [0, w, k]])
    dy, dx = np.array([[-s, 0, c], [0, 0, 0], [-c, 0, -s]]), np.array([[0, 0, 0], [0, -w, -k], [0, k, -w]])
    return y @ x, dy @ x, y @ dx


def legs(pitch, roll):
    """Lengths of both legs (m), and their derivatives by pitch and roll: J (2, 2), m/rad."""
    turned, *slopes = rotations(pitch, roll)
    legs = FOOT @ turned.T - SHANK
    lengths = np.linalg.norm(legs, axis=1)
    return lengths, np.array([((FOOT @ slope.T) * legs).sum(axis=1) / lengths for slope in slopes]).T


def posed(ankle, pitch, roll):
    guess = ankle.q_home.copy()
    guess[[ankle.q_index("joint1"), ankle.q_index("joint2")]] = pitch, roll
    return ankle.close(guess, locked=["joint1", "joint2"])


POSES = [*np.random.default_rng(5).uniform([-0.5, -0.3], [0.6, 0.3], (3, 2)), np.zeros(2)]


@pytest.mark.parametrize(("pitch", "roll"), POSES)
def test_motor_forces_are_the_moments_by_the_transposed_inverse_of_the_jacobian(robot, pitch, roll):
    ankle = robot("ankle")
    q = posed(ankle, pitch, roll)
    lengths, jacobian = legs(pitch, roll)
    np.testing.assert_allclose([q[ankle.q_index(joint)] for joint in ankle.actuated], lengths, atol=1e-9)
    np.testing.assert_allclose(ankle.placement(q, "platform").rotation, rotations(pitch, roll)[0], atol=1e-9)
    axes = np.array([[0.0, 1.0, 0.0], rotations(pitch, roll)[0][:, 0]])
    for moments in ((1.0, 0.0), (0.0, 1.0), (80.0, -20.0)):  # N m on the ground, about pitch and roll axis
        ground = cinegen.Payload("platform", wrench=(0.0, 0.0, 0.0, *(-np.array(moments) @ axes)))
        forces = cinegen.forces(ankle, q, payloads=[ground], gravity=(0.0, 0.0, 0.0))
        expected = np.linalg.solve(jacobian.T, moments)
        np.testing.assert_allclose(forces.torques, expected, atol=1e-9 * np.abs(expected).max())
        assert forces.undetermined == ()
