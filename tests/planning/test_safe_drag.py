"""`AvoidingSolver`: never too near while it is pulled about, and round what is in the way."""

from itertools import combinations, pairwise

import coal
import example_robots
import numpy as np
import pinocchio as pin
import pytest
from clearings import at, measured, to_shape
from example_robots import PANDA
from repository import load

from cinegen.collision import clearance_of, scene_of
from cinegen.errors import CinegenError
from cinegen.ik import AxisAlong, Range, Solver, Status
from cinegen.model.motion_limits import motion_limits
from cinegen.planning import AvoidingSolver
from cinegen.planning.encounters import HORIZON, Encounters, ObstacleMotion
from cinegen.planning.manoeuvres import Manoeuvre, ReactingJoints

SAFETY = 0.01
EXACT = 3e-6  # m: as exact as coal's distances to hulls and cylinders are


def scene(name, *obstacles, **more):
    mechanism = load(name)
    listed = [{"name": f"o{i}", **obstacle} for i, obstacle in enumerate(obstacles)]
    document = {"safety": SAFETY, "start": {}, "goal": {"point": [0.0, 0.0, 0.0]}, "obstacle": listed, **more}
    return scene_of(document, mechanism=mechanism)


def hand(scene_, dt=1e-3, acceleration=None):
    clearance = clearance_of(scene_)
    return AvoidingSolver(clearance, dt, scene_.safety, q=scene_.start, acceleration=acceleration), clearance


def pole(x, y):
    return {"kind": "cylinder", "radius": 0.03, "length": 1.2, "point": [x, y, 0.4]}


def moved(task, translation):
    task.target = pin.SE3(task.target.rotation, np.asarray(translation, dtype=float))


def balls_about(name, node, rng):
    """Four balls near a node at home, none of them too near."""
    mechanism, balls = load(name), []
    home = mechanism.placement(mechanism.q_home, node).translation
    while len(balls) < 4:
        away = rng.normal(size=3) * (1.0, 1.0, 0.0 if name == "planar_3r" else 1.0)
        place = home + rng.uniform(0.13, 0.45) * mechanism.length * away / np.linalg.norm(away)
        ball = {"kind": "sphere", "radius": 0.08 * mechanism.length, "point": place.tolist()}
        if clearance_of(scene(name, ball)).least(mechanism.q_home) > 1.5 * SAFETY:
            balls.append(ball)
    return balls


@pytest.mark.parametrize(
    ("name", "node", "dt", "acceleration"),
    [("arm7", "tool", 0.01, None), ("delta4", "platform", 0.01, None), ("planar_3r", "tool", 0.05, np.inf)],
)
def test_however_it_is_pulled_it_stays_clear_all_along(name, node, dt, acceleration):
    """Dragged into one ball after another, no step comes nearer than the safety distance, anywhere on it, by distances
    of coal itself; loops stay closed. Something is held off each time: no drag is harmless."""
    mechanism = load(name)
    rng = np.random.default_rng(0)
    balls = balls_about(name, node, rng)
    solver, clearance = hand(scene(name, *balls), dt, acceleration)
    task = solver.add_task(node, translation=3, rotation=0, axes="world")
    before, barred = solver.q, 0
    for tick in range(90):
        if tick % 30 == 0:
            moved(task, balls[tick // 30]["point"] + rng.uniform(-0.05, 0.05, 3) * mechanism.length)
        step = solver.step()
        for part in (0.5, 1.0):
            between = pin.interpolate(mechanism.model, before, step.q, part)
            assert measured(clearance, between).min() >= SAFETY - EXACT
        assert mechanism.closure(step.q) <= 1e-9
        barred += bool(step.active_barriers)
        before = step.q
    assert barred


def test_a_range_is_refused_and_its_task_taken():
    solver, _ = hand(scene("arm7"), 0.01, None)
    upright = AxisAlong("tool")
    with pytest.raises(CinegenError, match="add the range's task itself"):
        solver.add_task(Range(upright, radius=0.1))
    assert solver.add_task(upright) is upright


def test_it_goes_round_a_pole_where_a_damper_alone_is_held():
    """A rod across the way of a planar arm, the paper's figures 5 and 6, in the hand."""
    rod = {"kind": "box", "size": [0.24, 0.01], "point": [0.62, 0.0]}
    start = {"joints": {"joint1": -1.18, "joint2": 0.99, "joint3": 0.88}}
    goal = [0.6, 0.3, 0.0]

    def pulled(solver, ticks=1500):
        task = solver.add_task("tool", translation=2, rotation=0, axes="world")
        moved(task, goal)
        seen = set()
        for _ in range(ticks):
            step = solver.step()
            seen.add(step.status)
            if step.errors[0][0] < 1e-3:
                break
        return step, seen

    avoiding, clearance = hand(scene("planar_3r", rod, start=start), dt=4e-3)
    step, seen = pulled(avoiding)
    assert step.errors[0][0] < 1e-3
    assert Status.DETOUR in seen
    alone = Solver(avoiding.mechanism, 4e-3, scene("planar_3r", rod, start=start).start)
    alone.barriers = avoiding.barriers
    step, seen = pulled(alone, 400)
    assert step.errors[0][0] > 0.1
    assert step.status is Status.BARRED
    assert clearance.least(step.q) >= SAFETY


def test_tasks_are_suspended_after_a_tenth_of_a_second_at_rest_and_not_while_it_moves():
    """Straight into the middle of a wall: the approach takes longer than that, and is not interrupted. A target
    elsewhere ends it."""
    wall = {"name": "wall", "kind": "box", "point": [0.5, 0.0], "size": [0.1, 0.6]}
    solver, _ = hand(
        scene_of(
            {"mobile": {"radius": 0.05}, "safety": SAFETY, "start": {"point": [0.0, 0.0]},
             "goal": {"point": [2.0, 0.0]}, "obstacle": [wall]}
        )
    )  # fmt: skip
    task = solver.add_task("mobile", translation=2, rotation=0, axes="world")
    moved(task, [1.0, 0.0, 0.0])
    moving = resting = 0
    while (step := solver.step()).status is not Status.DETOUR:
        slow = float(np.abs(step.v / solver.mechanism.scale).max()) < 2e-3
        moving, resting = moving + (not slow), resting + slow
        assert resting <= 101
    assert moving > 110
    assert resting == pytest.approx(100, abs=1)  # ticks of 1 ms
    moved(task, [-0.5, 0.0, 0.0])
    assert solver.step().status is Status.FOLLOWING


def test_a_pull_that_makes_no_sense_beside_one_that_is_held_off():
    """Neither raises, nor moves what it must not."""
    solver, clearance = hand(scene("arm7", pole(0.45, 0.0)))
    tool = solver.add_task("tool", translation=3, rotation=0)
    other = solver.add_task("link4", translation=3, rotation=0)
    x, y, z = tool.target.translation
    for wrong in ("nowhere", None, pin.SE3(np.eye(3), np.full(3, np.nan))):
        other.target = wrong
        moved(tool, [x, -y - 0.6, z])
        for _ in range(150):
            step = solver.step()
            assert step.status is Status.BAD_TARGET
        assert clearance.least(step.q) >= SAFETY


def test_a_fault_of_its_own_is_reported_and_it_stays_clear(monkeypatch, caplog):
    """What goes wrong in looking for a path is no secret: it is in the step, and in the log once."""
    solver, clearance = hand(scene("arm7", pole(0.45, 0.0)), acceleration=np.inf)  # from too near: away at once
    task = solver.add_task("tool", rotation=0)
    x, y, z = task.target.translation
    moved(task, [x, -y - 0.6, z])
    assert solver.step().exceptions == ()

    def broken(*_):
        raise ZeroDivisionError("of the package's own")

    monkeypatch.setattr(solver.vortices, "deflect", broken)
    for _ in range(100):
        step = solver.step()
        assert [type(error) for error in step.exceptions] == [ZeroDivisionError]
        assert step.closure <= 1e-10
        assert clearance.least(step.q) >= SAFETY
    records = [record for record in caplog.records if record.name == "cinegen"]
    assert len(records) == 1
    assert "around obstacles of arm: ZeroDivisionError: of the package's own" in records[0].getMessage()
    assert "in broken" in caplog.text
    monkeypatch.undo()
    assert solver.step().exceptions == ()


@pytest.mark.filterwarnings("error")
def test_a_target_may_be_as_far_away_as_numbers_go():
    solver, _ = hand(scene("planar_3r", pole(0.6, 0.3)))
    task = solver.add_task("tool", rotation=0)
    for far in (1e192, -1e300, 1.0):
        moved(task, [far, far, 0.0])
        step = solver.step()
        assert not step.exceptions
        assert np.isfinite(step.q).all()


# --- safe drag moving -------------------------------------------------------------------------------------------------
# `AvoidingSolver` among obstacles that move: accelerations by finite differences, distances by coal.


DT, ACCELERATION, SPEED = 1 / 240, 10.0, 1.0


def among_a_ball(name):
    """A solver, its clearance, and a ball of 5 cm far away."""
    ball = {"name": "ball", "kind": "sphere", "radius": 0.05, "point": [9.0, 9.0, 0.0]}
    return hand(scene(name, ball), DT, ACCELERATION)


def run(solver, clearance, begin, velocity, ticks):
    """Move the ball at a constant velocity. Return configurations, distances by coal, statuses and threats."""
    q, least, statuses, threats = [solver.q], [], [], []
    for tick in range(ticks):
        ball = begin + velocity * (tick * solver.dt)
        solver.move(0, at(*ball))
        step = solver.step()
        assert step.exceptions == ()
        q.append(step.q)
        least.append(distance(clearance, step.q, ball))
        statuses.append(step.status)
        threats.append(solver.threat)
    return np.array(q), np.array(least), statuses, threats


def distance(clearance, q, ball):
    """The least distance of all moving links from the ball, by coal."""
    return to_shape(clearance.mechanism, clearance.links, q, coal.Sphere(0.05), at(*ball))


def accelerations(mechanism, q):
    """The largest one of an actuated joint by finite differences, from rest."""
    v = np.array([pin.difference(mechanism.model, a, b) for a, b in pairwise(q)]) / DT
    changes = np.diff(np.vstack([np.zeros_like(v[:1]), v]), axis=0) / DT
    return float(np.abs(changes[:, [mechanism.v_index(joint) for joint in mechanism.actuated]]).max())


def test_a_ball_that_comes_is_evaded():
    """From the side to the tool of an arm at 1 m/s: half of the safety distance is kept at least."""
    solver, clearance = among_a_ball("arm7")
    home = solver.mechanism.placement(solver.q, "tool").translation
    solver.add_task("tool", rotation=0)
    side = np.array([0.0, 1.0, 0.0])
    q, least, statuses, _ = run(solver, clearance, home - 0.8 * side, SPEED * side, 192)
    assert least.min() >= 0.5 * SAFETY
    assert not {Status.UNAVOIDABLE, Status.IN_COLLISION} & set(statuses)
    assert min(distance(clearance, q[0], home + s * side) for s in np.linspace(-0.1, 0.1, 21)) < 0.0  # at rest


@pytest.mark.parametrize("name", ["arm7", "delta4"])
def test_the_status_and_the_threat_where_a_collision_is_not_avoided(name):
    """A ball at 1 m/s through a link near the base, which can't get away; it goes on through the robot."""
    solver, clearance = among_a_ball(name)
    mechanism = solver.mechanism
    task = solver.add_task(mechanism.end, rotation=0)
    task.target = pin.SE3(task.target.rotation, task.target.translation + 0.02)
    if name == "delta4":  # its platform gets out of the way of slower ones
        end = mechanism.placement(solver.q, mechanism.end).translation
        begin, velocity = end - [0.0, 0.0, 0.8], np.array([0.0, 0.0, 8.0])
    else:
        body = next(link for link in clearance.links if link.joint == 1)
        data = mechanism.model.createData()
        pin.forwardKinematics(mechanism.model, data, solver.q)
        begin = data.oMi[1].act(np.asarray(body.centre)) - np.array([0.0, 0.8, 0.0])
        velocity = np.array([0.0, 1.0, 0.0])
    q, least, statuses, threats = run(solver, clearance, begin, velocity, 200)
    hit = int(np.argmax(least <= 0.0))
    assert least[hit] <= 0.0
    assert Status.UNAVOIDABLE in statuses[:hit]
    assert Status.IN_COLLISION in statuses[hit:]
    warned = next(threat for threat in threats if threat is not None)
    assert warned.pair[1].startswith("ball")
    assert not warned.happens
    assert accelerations(mechanism, q) <= ACCELERATION * (1.0 + 1e-6)
    assert min(np.abs(np.diff(q[hit:], axis=0)).max(axis=1)) < 1e-9 * DT  # it comes to a full stop
    assert max(map(mechanism.closure, q)) <= 1e-9


# --- braking ----------------------------------------------------------------------------------------------------------
# Accelerations of joints that brake before limits of position, next to others that take longer.


READY = 0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785, 0.02
OBSTACLES = [
    {"name": "table", "kind": "box", "size": [2.0, 2.0, 0.1], "point": [0.0, 0.0, -0.1]},
    {"name": "wall", "kind": "box", "size": [0.1, 1.0, 1.0], "point": [0.75, 0.0, 0.3]},
    {"name": "left", "kind": "sphere", "radius": 0.15, "point": [0.45, 0.45, 0.4]},
    {"name": "right", "kind": "sphere", "radius": 0.15, "point": [0.45, -0.45, 0.4]},
]


ROCKER = """robot rocker { base { }
  link 1 { parameters { theta 50.0 } type 2 pred 0 limits { 31 212 } }
  link 2 { parameters { theta -25.722522 d 120.0 } type 2 pred 1 }
  link 3 { parameters { theta 88.735117 d 400.0 } type 2 pred 0 actuated 1 }
  frame 4 { parameters { d 360.0 } pred 2 }
  frame 5 { parameters { d 240.0 } pred 3 }
  frame 6 { name "tool" parameters { d 120.0 } pred 1 }
  constraint { frame 4 frame 5 type 2 }
}"""
"""A four-bar that its rocker drives. At 29.93 degrees the crank is in line with the coupler."""


def test_a_passive_joint_brakes_near_a_dead_centre_by_what_the_actuated_one_can(raff):
    """At an angle x from the line the rocker is k x^2 from its own end. So that the crank stops at d, v^2 must be below
    2 a k (x^2 - d^2) for the rocker; braking of all joints in proportion would allow 4 a k x (x - d)."""
    rocker = raff(ROCKER)
    document = {"start": {}, "goal": {"point": [0.0, 0.0]}, "allowed_collisions": [*combinations(rocker.nodes, 2)]}
    solver = AvoidingSolver(clearance_of(scene_of(document, mechanism=rocker)), DT, SAFETY, acceleration=ACCELERATION)
    moved(solver.add_task("tool", rotation=0), [0.118, 0.021, 0.0])
    q = np.array([solver.q, *(solver.step().q for _ in range(240))])
    assert np.degrees(q[:, 0].min()) == pytest.approx(31.0, abs=0.1)
    assert accelerations(rocker, q) <= ACCELERATION * (1.0 + 1e-6)


def test_an_arm_whose_fingers_are_coupled_obeys_its_limits():
    """Targets of the hand and of a finger jump, among obstacles: steps are refused, joints at their limits. The fingers
    brake together, but not as long as the arm, whose joints brake alone."""
    panda = example_robots.load(PANDA)
    start = {"joints": dict(zip(panda.actuated, READY, strict=True))}
    document = {"safety": 0.01, "start": start, "goal": {"point": [0.0, 0.0, 0.0]}, "obstacle": OBSTACLES}
    scene = scene_of(document, mechanism=panda)
    solver, rng = AvoidingSolver(clearance_of(scene), DT, 0.01, q=scene.start), np.random.default_rng(0)
    hand = solver.add_task("panda_hand", rotation=0, axes="world")
    finger = solver.add_task("panda_leftfinger", rotation=0, axes="world")
    home, q = hand.target.translation.copy(), [solver.q]
    for tick in range(320):
        if tick % 40 == 0:
            aim, open_by = home + rng.uniform(-0.5, 0.5, 3), rng.choice([-0.05, 0.1])
        held, at = panda.placement(solver.q, "panda_hand"), panda.placement(solver.q, "panda_leftfinger")
        hand.target = pin.SE3(hand.target.rotation, aim)
        finger.target = pin.SE3(at.rotation, held.act(np.array([0.0, open_by, 0.0584])))
        q.append(solver.step().q)
    moved = np.array(q)
    changes = np.diff(np.vstack([moved[:1], moved]), n=2, axis=0) / DT**2
    limits = motion_limits(panda).acceleration
    limits[panda.v_index("panda_finger_joint2")] = limits[panda.v_index("panda_finger_joint1")]  # it is coupled to it
    assert (np.abs(changes) <= limits * (1.0 + 1e-6)).all()
    assert np.ptp(moved[:, -1]) > 0.03


# --- encounters -------------------------------------------------------------------------------------------------------
# Predicted distances from obstacles that move, against coal at instants that are 1 ms apart.


INSTANT, STRIDE = 1e-3, 5e-3
BOX = np.array([0.2, 0.06, 0.1])


def reacting(name, dt, *obstacles):
    """A clearance among obstacles, and the joints that react in ticks of `dt`."""
    clearance = clearance_of(scene(name, *obstacles))
    joints = ReactingJoints(load(name), clearance.links, motion_limits(load(name)).acceleration)
    joints.dt = dt
    return clearance, joints


@pytest.mark.parametrize("spin", [0.0, 3.0])
def test_no_distance_below_the_safety_distance_is_overlooked(spin):
    """A box crosses the workspace of an arm that brakes, or accelerates and brakes; where it stays far enough away, so
    does it at all instants in between, and where not, the first such instant and the least distance are found."""
    mechanism, rng = load("arm7"), np.random.default_rng(0)
    box = {"name": "box", "kind": "box", "size": BOX.tolist(), "point": [9.0, 9.0, 0.0]}
    clearance, joints = reacting("arm7", INSTANT, box)
    encounters, outcomes = Encounters(clearance, SAFETY, joints), []
    times = np.arange(0.0, HORIZON, INSTANT)
    for number in range(12):
        q = mechanism.q_home + rng.uniform(-0.5, 0.5, 7)
        v = rng.uniform(-1.0, 1.0, 7) * (number % 2)
        manoeuvre = joints.manoeuvre(q, v, rng.uniform(-1.0, 1.0, 7), 0.2) if number % 3 else joints.braking
        pose, velocity = _course(mechanism, q, rng)
        motion = ObstacleMotion(pose, 0)
        turn = pin.exp3(np.array([0.0, 0.0, spin * INSTANT]))
        motion.update(pin.SE3(turn @ pose.rotation, pose.translation + velocity * INSTANT), 1, INSTANT)
        assert encounters.follow({0: motion}, 1)
        meeting = encounters.meet(q, v, manoeuvre)
        moved = joints.roll_out(v, manoeuvre, times).moved
        dense = np.array([
            to_shape(mechanism, clearance.links, q + by, coal.Box(*BOX), motion.pose(1, float(t)))
            for t, by in zip(times, moved, strict=True)
        ])  # fmt: skip
        if dense[0] < 2.0 * SAFETY:
            continue
        outcomes.append(dense.min() < SAFETY)
        low = np.flatnonzero(dense < SAFETY - STRIDE)
        if len(low):
            assert meeting.first <= low[0] * INSTANT + 1e-9
            assert meeting.place is not None
        if dense.min() >= SAFETY:
            assert meeting.first == np.inf
        assert meeting.least >= dense.min() - 1e-6 or dense.min() <= 0.0  # no instant is made up
    assert any(outcomes)
    assert not all(outcomes)


def _course(mechanism, q, rng):
    """A pose about half a metre from a point of the arm, and a velocity past it at 0.6 to 2 m/s."""
    aim = mechanism.placement(q, f"link{rng.integers(3, 7)}").translation + rng.uniform(-0.15, 0.15, 3)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    return pin.SE3(pin.exp3(rng.normal(size=3)), aim - 0.6 * direction), rng.uniform(0.6, 2.0) * direction


# --- manoeuvres -------------------------------------------------------------------------------------------------------
# Manoeuvres: against plain integration; and their checks against what is at rest, by coal in fine steps.


@pytest.mark.parametrize("seed", range(2))
def test_a_manoeuvre_is_what_its_ticks_add_up_to(seed):
    _, joints = reacting("planar_3r", DT)
    rng = np.random.default_rng(seed)
    v_start = np.round(rng.uniform(-1.0, 1.0, 3), 2)
    remaining = Manoeuvre(rng.uniform(-1.0, 1.0, 3) * joints.limits, np.full(3, 48 * DT))
    whole, v, moved, speeds = remaining, v_start.copy(), np.zeros(3), []
    for _ in range(120):
        after = joints.next_velocity(v, remaining)
        assert (np.abs(after - v) <= joints.limits * DT * (1.0 + 1e-9)).all()
        v, remaining = after, remaining.after(DT)
        moved += v * DT
        speeds.append(np.abs(v))
    rolled = joints.roll_out(v_start, whole, np.array([120 * DT]))
    assert rolled.velocity[0] == pytest.approx(v, abs=1e-9)
    assert rolled.moved[0] == pytest.approx(moved, abs=2e-4)  # a phase may end within a tick
    assert (np.max(speeds, axis=0) <= joints.fastest_between(v_start, whole, 0.0, 120 * DT) + 1e-9).all()
    end = joints.duration(v_start, whole)
    last = np.abs(joints.roll_out(v_start, whole, np.array([0.99 * end, end])).velocity).max(axis=1)
    assert last[1] <= 1e-9 < last[0]


@pytest.mark.parametrize("name", ["arm7", "five_bar"])
def test_a_manoeuvre_ends_within_the_limits_of_position(name):
    mechanism, (_, joints) = load(name), reacting(name, DT)
    rng, at = np.random.default_rng(0), [mechanism.q_index(name) for name in mechanism.actuated]
    low, high = mechanism.limits.lower[at], mechanism.limits.upper[at]
    for _ in range(20):
        q = mechanism.q_home.copy()
        q[at] = rng.uniform(low, high)
        v = np.zeros(mechanism.model.nv)
        manoeuvre = joints.manoeuvre(q, v, rng.uniform(-1.0, 1.0, len(at)), 9.0)
        end = joints.roll_out(v, manoeuvre, np.array([joints.duration(v, manoeuvre)])).moved[0]
        assert (q[at] + end >= low).all()
        assert (q[at] + end <= high).all()


@pytest.mark.parametrize("where", [0.15, 0.45, 0.75])
def test_a_thin_obstacle_anywhere_along_a_manoeuvre_is_met(where):
    """A rod of 2 mm, which few instants would miss, somewhere in the arc of the tool."""
    mechanism = load("planar_3r")
    _, joints = reacting("planar_3r", DT)
    q, v = mechanism.q_home, np.zeros(3)
    turning = Manoeuvre(joints.limits * [1.0, 0.0, 0.0], np.array([0.4, 0.0, 0.0]))
    end = joints.duration(v, turning)
    moved = joints.roll_out(v, turning, np.linspace(0.0, end, 400)).moved
    path = [joints.configuration(q, motion, q) for motion in moved]
    at = mechanism.placement(path[int(where * 400)], "tool").translation
    rod = {"name": "rod", "kind": "disc", "radius": 1e-3, "point": [float(at[0]), float(at[1])]}
    far = {**rod, "point": [-3.0, -3.0]}
    for obstacle, is_free in ((rod, False), (far, True)):
        ball = {"name": "ball", "kind": "disc", "radius": 0.05, "point": [9.0, 9.0]}
        clearance, joints = reacting("planar_3r", DT, obstacle, ball)
        encounters = Encounters(clearance, 0.01, joints)
        truth = min(clearance.least(sample) for sample in path)
        assert (truth > 0.01) is is_free
        assert encounters.is_clear_of_rest(q, v, turning) is is_free
