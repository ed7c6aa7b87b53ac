"""`ForwardKinematics` stays on its branch, which is proved: judged by tiny steps, and signs of determinants."""

import numpy as np
import pytest

import cinegen
from cinegen.devices import Lines
from cinegen.model import ForwardKinematics
from raff2urdf import closure

ROBOTS = ("delta4", "five_bar", "hybrid")


PARALLELOGRAM = """RAFF Parallelogram
robot r {
  base { }
  link 1 { parameters { theta 60 } type 2 pred 0 }
  link 2 { parameters { d 100 theta -60 } type 2 pred 1 }
  link 3 { parameters { d 200 theta 60 } type 2 pred 0 }
  frame 4 { parameters { d 200 } pred 2 }
  frame 5 { parameters { d 100 } pred 3 }
  constraint { frame 4 frame 5 type 2 }
}
"""


def actuated_goal(mechanism, change):
    """Values of the actuated joints, by dimensionless changes from home."""
    names = mechanism.actuated
    return {
        name: float(mechanism.q_home[mechanism.q_index(name)] + x * mechanism.scale[mechanism.v_index(name)])
        for name, x in zip(names, change.tolist(), strict=True)
    }


def in_lines(motion, mechanism, change, lines):
    """The configuration after a motion in so many moves; None if one of them fails."""
    motion.q = mechanism.q_home
    try:
        for k in range(1, lines + 1):
            motion.move(actuated_goal(mechanism, change * (k / lines)))
    except cinegen.ClosureError:
        return None
    return motion.q


def in_tiny_steps(mechanism, change, steps=800):
    """Likewise by Newton steps in numpy; None where the determinant changes its sign, or is nearly 0."""
    system, columns = mechanism.structure.system, mechanism.structure.passive_columns
    free = np.zeros(mechanism.model.nv, dtype=bool)
    free[columns] = True
    q, sides = mechanism.q_home, set()
    for k in range(1, steps + 1):
        start = q.copy()
        for name, value in actuated_goal(mechanism, change * (k / steps)).items():
            start[mechanism.q_index(name)] = value
        closing = closure.close(system, start, free, 20)
        rows = system.evaluate(closing.q)[1][:, free]
        before = system.evaluate(q)[1][:, free]
        sides.add(np.sign(np.linalg.det(before.T @ rows)))
        smallest = np.linalg.svd(rows, compute_uv=False)[-1]
        if not closing.closed or sides != {1.0} or smallest < 2e-3 or np.abs(closing.q - q).max() > 0.1:
            return None
        q = closing.q
    return q


@pytest.mark.parametrize("name", ROBOTS)
def test_the_number_of_lines_does_not_matter_and_the_branch_is_proved(robot, name):
    mechanism = robot(name)
    motion, rng, reached = ForwardKinematics(mechanism), np.random.default_rng(3), 0
    for _ in range(9):
        change = rng.uniform(-1.0, 1.0, len(mechanism.actuated)) * rng.choice([0.02, 0.1, 0.7])
        ends = [in_lines(motion, mechanism, change, lines) for lines in (1, 2, 3, 60)]
        assert len({end is None for end in ends}) == 1
        if ends[0] is not None:
            assert motion.is_proved
            np.testing.assert_allclose(ends[1:], [ends[0]] * 3, atol=1e-8)
            reached += 1
    assert reached >= 3


@pytest.mark.parametrize("name", ["delta4"])
def test_ends_are_those_of_tiny_steps_and_singularities_are_not_passed(robot, name):
    mechanism = robot(name)
    motion, rng, reached = ForwardKinematics(mechanism), np.random.default_rng(5), 0
    for _ in range(5):
        change = rng.uniform(-1.0, 1.0, len(mechanism.actuated))
        expected, end = in_tiny_steps(mechanism, change), in_lines(motion, mechanism, change, 1)
        if expected is not None:
            assert end is not None
            np.testing.assert_allclose(end, expected, atol=1e-8)
            reached += 1
    assert reached >= 3


def test_a_parallelogram_is_not_led_through_its_flat_position():
    """There it may become an antiparallelogram: short moves would pass it as one long move would."""
    mechanism = cinegen.load(PARALLELOGRAM)
    motion = ForwardKinematics(mechanism)
    for lines in (1, 7, 300):
        assert in_lines(motion, mechanism, np.array([2.0 * np.pi]), lines) is None
    for change in (-0.5, 0.5):
        assert in_lines(motion, mechanism, np.array([change]), 1) is not None
        assert motion.is_proved
    with pytest.raises(cinegen.ClosureError, match=r"the motion ends at .*, near a singularity"):
        motion.move({mechanism.actuated[0]: 6.0})


@pytest.mark.parametrize("name", ["delta4", "tssm", "sr400"])
def test_derivatives_of_loops_are_bounded_as_the_proof_says(robot, name):
    """|F''[v, v]| <= h S^2 with levers and widths from Pinocchio's Jacobians, at random closed configurations."""
    mechanism = robot(name)
    system, rng, size = mechanism.structure.system, np.random.default_rng(0), 1e-3
    for q in mechanism.random_closed(5, 1):
        v = rng.normal(size=mechanism.model.nv)
        ahead, back = (system.evaluate(system.integrate(q, sign * size * v))[0] for sign in (1.0, -1.0))
        second = (ahead + back) / size**2
        system.evaluate(q)
        columns, row = np.asarray(system.data.J) * system.scale, 0
        for i, (loop, anchor) in enumerate(zip(system.loops, system.anchors, strict=True)):
            own = system.columns[i]
            end = (system.data.oMi[anchor[2]] * anchor[3]).translation
            speed = np.linalg.norm(columns[:3, own].T + np.cross(columns[3:, own].T, end), axis=1) / system.length
            turned = np.linalg.norm(columns[3:, own], axis=0)
            width = np.where(turned > 0.0, turned, speed)
            lever = max(1.0, (speed / np.where(turned > 0.0, turned, np.inf)).max())
            travelled = float(width @ np.abs(v[own]))
            found = np.linalg.norm(second[row : row + loop.rows])
            assert found <= np.hypot(lever, 1.0) * travelled**2 * (1.0 + 1e-2)
            row += loop.rows


def test_where_nothing_can_be_proved_that_is_said(robot):
    """One of the two actuated joints of a five-bar is passive: it is not determined."""
    mechanism = cinegen.load("five_bar", actuated=robot("five_bar").actuated[:1])
    motion = ForwardKinematics(mechanism)
    (name,) = mechanism.actuated
    value = float(motion.q[mechanism.q_index(name)]) + 0.05
    motion.move({name: value})
    assert not motion.is_proved
    motion.q = motion.q
    assert motion.is_proved
    lines = Lines(mechanism)
    with pytest.warns(cinegen.CinegenWarning, match="not proved to be on the branch"):
        lines.answer(f'{{"{name}": {value + 0.01}}}')
    lines.answer(f'{{"{name}": {value + 0.02}}}')  # without a warning
