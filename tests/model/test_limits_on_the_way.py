"""`ForwardKinematics` within limits: a motion on which a joint passes a limit is refused, even if it comes back. Judged
by walks in tiny steps."""

import pickle
import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
from slow_motion import walk
from small_robots import four_bar

import cinegen
from cinegen.devices import Lines
from cinegen.errors import LimitError
from cinegen.model import ForwardKinematics
from cinegen.session.motion import ConfigurationMotion, JointMotion
from raff2urdf import closure

AGAIN = re.compile(r"(\w+) would pass its limit (\S+) (?:rad|m), as it follows, with (.*) \((\S+) % of the motion\)")


def limited(mechanism, **limits):
    """The mechanism with other limits of some joints: lower, upper."""
    model = mechanism.model.copy()
    lower, upper = model.lowerPositionLimit.copy(), model.upperPositionLimit.copy()
    lower[:], upper[:] = -np.inf, np.inf
    for name, (least, greatest) in limits.items():
        lower[mechanism.q_index(name)], upper[mechanism.q_index(name)] = least, greatest
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    return replace(mechanism, model=model)


def goals(mechanism, change):
    """Values of the actuated joints, by changes from home."""
    at = [mechanism.q_index(name) for name in mechanism.actuated]
    return dict(zip(mechanism.actuated, (mechanism.q_home[at] + change).tolist(), strict=True))


def walked_by(mechanism, change, steps=600):
    """(steps + 1, nq) configurations on a straight motion from home; None if they jump."""
    return walk(mechanism, mechanism.q_home, np.array(list(goals(mechanism, change).values())), steps)


def out_and_back(mechanism, change, joint):
    """A motion, and the greatest value of a passive joint on it, above both ends."""
    values = walked_by(mechanism, change)[:, mechanism.q_index(joint)]
    top = int(values.argmax())
    assert values[top] > max(values[0], values[-1]) + 1e-3
    a, b, c = values[top - 1 : top + 2]  # extremum of the parabola through three points
    return b + (c - a) ** 2 / (8.0 * (2.0 * b - a - c))


@pytest.mark.parametrize(("name", "change", "joint"), [
    ("four_bar", [6.2], "joint3"), ("delta4", [0.885, 0.36, 1.335], "joint10"), ("five_bar", [-1.1, 1.4], "joint2"),
])  # fmt: skip
def test_a_joint_that_leaves_its_limit_and_comes_back_is_told(robot, name, change, joint):
    mechanism, change = robot(name), np.array(change)
    top = out_and_back(mechanism, change, joint)
    for beyond in (2e-2, 1e-6):  # 1e-6 rad are passed within 0.003 rad of a crank
        limit = top - beyond
        motion = ForwardKinematics(limited(mechanism, **{joint: (-9.0, limit)}), within_limits=True)
        with pytest.raises(cinegen.CinegenError, match=AGAIN) as caught:
            motion.move(goals(mechanism, change))
        said = AGAIN.match(str(caught.value))
        assert (said[1], float(said[2])) == (joint, pytest.approx(limit, rel=1e-5))
        assert np.array_equal(motion.q, mechanism.q_home)  # nothing has moved, and it still can
        part = float(said[4]) / 100.0
        place = {entry.split()[0]: float(entry.split()[2]) for entry in said[3].split(", ")}
        assert place == pytest.approx(goals(mechanism, change * part), abs=0.02)
        q = ForwardKinematics(mechanism).move(place)  # where the limit is reached
        assert q[mechanism.q_index(joint)] == pytest.approx(limit, abs=1e-4)
    motion = ForwardKinematics(limited(mechanism, **{joint: (-9.0, top + 1e-6)}), within_limits=True)
    end = motion.move(goals(mechanism, change))
    assert motion.is_proved
    assert end == pytest.approx(ForwardKinematics(mechanism).move(goals(mechanism, change)), abs=1e-9)


@pytest.mark.parametrize("name", ["four_bar", "delta4", "tssm"])
def test_motions_keep_limits_exactly_if_tiny_steps_do(robot, name):
    mechanism, rng, verdicts = robot(name), np.random.default_rng(8), set()
    scale = mechanism.scale[[mechanism.v_index(joint) for joint in mechanism.actuated]]
    passive = [joint for joint in mechanism.joints if joint not in mechanism.actuated]
    for _ in range(2):
        change = rng.uniform(-0.8, 0.8, len(scale)) * scale * (0.3 if name == "tssm" else 1.0)
        walked = walked_by(mechanism, change, 150)
        if walked is None:
            continue
        for _ in range(6):
            joint = rng.choice(passive)
            values = walked[:, mechanism.q_index(joint)]
            span = values.max() - values.min()
            limit = values[0] + rng.uniform(-1.2, 1.2) * max(span, 1e-3)
            bounds = (limit, np.inf) if limit < values[0] else (-np.inf, limit)
            inside = bounds[0] <= values.min() and values.max() <= bounds[1]
            if min(abs(values.min() - limit), abs(values.max() - limit)) < 1e-3 * span:
                continue
            motion = ForwardKinematics(limited(mechanism, **{joint: bounds}), within_limits=True)
            if inside:
                motion.move(goals(mechanism, change))
            else:
                with pytest.raises(cinegen.CinegenError, match=f"^{joint} would pass its limit"):
                    motion.move(goals(mechanism, change))
            verdicts.add(inside)
    assert verdicts == {True, False}


def test_a_joint_beyond_its_limit_may_come_back_only(robot):
    bar = robot("four_bar")
    home = bar.q_home[bar.q_index("joint3")]
    motion = ForwardKinematics(limited(bar, joint3=(home + 0.1, 9.0)), within_limits=True)
    way = np.sign(walked_by(bar, np.array([0.1]), 10)[-1, bar.q_index("joint3")] - home)
    with pytest.raises(cinegen.CinegenError, match=r"joint3 would pass its limit .* \(0 % of the motion\)"):
        motion.move(goals(bar, np.array([-0.01 * way])))
    motion.move(goals(bar, np.array([0.01 * way])))
    with pytest.raises(cinegen.CinegenError, match="joint3 would pass"):
        motion.move(goals(bar, np.array([0.0])))
    assert pickle.loads(pickle.dumps(motion)).within_limits


def test_motions_of_a_session_keep_limits_within_a_tick(robot):
    """The crank of a four-bar turns once in a tick; its coupler's joint leaves its range and comes back."""
    mechanism, change = robot("four_bar"), np.array([6.2])
    top = out_and_back(mechanism, change, "joint3")
    narrow, goal = limited(mechanism, joint3=(-9.0, top - 1e-3)), goals(mechanism, change)
    end = ForwardKinematics(mechanism).move(goal)
    slider = JointMotion(narrow, mechanism.q_home)
    for joint, value in goal.items():
        slider.move(joint, value)
    assert np.array_equal(slider.advance(100.0), mechanism.q_home)
    assert slider.problem == "at the limit of joint3"
    hexapod = robot("gough")
    slider = JointMotion(hexapod, hexapod.q_home)
    slider.move("joint3", hexapod.limits["joint3"].upper)
    assert np.array_equal(slider.advance(100.0), hexapod.q_home)
    assert slider.problem == "its loops can't follow on this branch"
    motion = ConfigurationMotion(narrow, mechanism.q_home, end, "home", "moving home")
    assert np.array_equal(motion.advance(100.0), end)
    assert motion.problem == "joint3 would pass a limit in between: the robot was moved there without a path"


# --- proved branches --------------------------------------------------------------------------------------------------


def in_lines(motion, mechanism, change, lines):
    """The configuration after a motion in so many moves, by dimensionless changes; None if one of them fails."""
    motion.q = mechanism.q_home
    change = change * mechanism.scale[[mechanism.v_index(joint) for joint in mechanism.actuated]]
    try:
        for k in range(1, lines + 1):
            motion.move(goals(mechanism, change * (k / lines)))
    except cinegen.ClosureError:
        return None
    return motion.q


def test_a_parallelogram_is_not_led_through_its_flat_position():
    """There it may become an antiparallelogram: short moves would pass it as one long move would."""
    mechanism = cinegen.load(four_bar((60, -60, 60), (100, 200, 200, 100)))
    motion = ForwardKinematics(mechanism)
    for lines in (1, 7, 300):
        assert in_lines(motion, mechanism, np.array([2.0 * np.pi]), lines) is None
    for change in (-0.5, 0.5):
        assert in_lines(motion, mechanism, np.array([change]), 1) is not None
        assert motion.is_proved
    with pytest.raises(cinegen.ClosureError, match=r"the motion ends at .*, near a singularity"):
        motion.move({mechanism.actuated[0]: 6.0})
    flat = ForwardKinematics(cinegen.load(four_bar((0, 0, 0), (100, 200, 200, 100))))
    with pytest.raises(cinegen.ClosureError):  # nor away from it: both linkages begin there
        flat.move({mechanism.actuated[0]: 0.05})


def loops_at(mechanism, q):
    """Of each loop its rows, its DoF, D, and w of each of its joints, by Pinocchio's Jacobians."""
    system, row = mechanism.structure.system, 0
    system.evaluate(q)
    columns = np.asarray(system.data.J) * system.scale
    for dofs, loop, anchor in zip(system.columns, system.loops, system.anchors, strict=True):
        end = (system.data.oMi[anchor[2]] * anchor[3]).translation
        speed = np.linalg.norm(columns[:3, dofs].T + np.cross(columns[3:, dofs].T, end), axis=1) / system.length
        turned = np.linalg.norm(columns[3:, dofs], axis=0)
        lever = max(1.0, (speed / np.where(turned > 0.0, turned, np.inf)).max())
        yield slice(row, row + loop.rows), dofs, lever, np.where(turned > 0.0, turned, speed)
        row += loop.rows


@pytest.mark.parametrize("name", ["delta4", "tssm", "sr400"])
def test_derivatives_of_loops_are_bounded_as_the_proof_says(robot, name):
    """|F''[v, v]| <= h S^2 at random closed configurations."""
    mechanism = robot(name)
    system, rng, size = mechanism.structure.system, np.random.default_rng(0), 1e-3
    for q in mechanism.random_closed(5, 1):
        v = rng.normal(size=mechanism.model.nv)
        ahead, back = (system.evaluate(system.integrate(q, sign * size * v))[0] for sign in (1.0, -1.0))
        second = (ahead + back) / size**2
        for rows, dofs, lever, width in loops_at(mechanism, q):
            travelled = float(width @ np.abs(v[dofs]))
            assert np.linalg.norm(second[rows]) <= np.hypot(lever, 1.0) * travelled**2 * (1.0 + 1e-2)


def contraction(mechanism, change):
    """The proof's bound of k for a step from home, in numpy: with the least r for k = 1/2. All joints turn, and loops
    are rigid."""
    system, q, v = mechanism.structure.system, mechanism.q_home, np.zeros(mechanism.model.nv)
    moves = np.isin(np.arange(len(v)), [mechanism.v_index(joint) for joint in mechanism.actuated])
    jacobian = system.evaluate(q)[1]
    inverse = np.linalg.pinv(jacobian[:, ~moves])
    v[moves] = change
    v[~moves] = -inverse @ jacobian[:, moves] @ v[moves]
    end = closure.close(system, q + v, ~moves, 20).q
    off, curved, spread = np.linalg.norm(end - q - v), 0.0, 0.0
    bound = np.linalg.norm(np.eye(len(inverse)) - inverse @ system.evaluate(end)[1][:, ~moves])
    for rows, dofs, lever, width in loops_at(mechanism, end):
        travelled, wide = float(width @ np.abs(v[dofs])), np.linalg.norm(width[~moves[dofs]])
        bent = np.linalg.norm(inverse[:, rows]) * np.hypot(lever / (1.0 - travelled - 0.1), 1.0)
        bound += bent * wide * travelled**2 / 8.0
        curved += bent * travelled**3 / 40.0
        spread += bent * wide**2
    return bound + spread * (off + 2.0 * (1.5 * off + curved))


def test_the_longest_step_that_is_made_at_once_is_the_longest_that_is_proved(robot):
    mechanism = robot("delta4")
    motion, longest, too_long = ForwardKinematics(mechanism), 0.0, 0.1
    while too_long - longest > 1e-7:
        change, motion.q = 0.5 * (longest + too_long), mechanism.q_home
        motion.move(goals(mechanism, change))
        is_made_at_once = motion._memory.tangent[mechanism.v_index("joint1")] == pytest.approx(change)
        longest, too_long = (change, too_long) if is_made_at_once else (longest, change)
    assert contraction(mechanism, longest) == pytest.approx(0.5, abs=1e-4)


def test_where_steps_are_not_proved_the_limit_is_passed_further_on(raff):
    """A follower of 0.9 x - 0.0025 x^2 degrees passes 75 degrees at x = 130.98; nothing is proved of polynomials."""
    arm = raff("""robot arm {
      link 1 { type 2 pred 0 actuated 1 }
      link 2 { type 2 pred 1 limits { 0 75 } }
      coupling { link 2 link 1 polynomial ( 0.9 -0.0025 ) }
    }""")
    with pytest.raises(LimitError, match=r"as it follows, past joint1 at (\S+) rad") as caught:
        ForwardKinematics(arm, within_limits=True).move({"joint1": 3.0})
    assert float(re.search(r"past joint1 at (\S+)", str(caught.value))[1]) < np.radians(130.98)


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
    with warnings.catch_warnings(action="error"):
        lines.answer(f'{{"{name}": {value + 0.02}}}')
