"""Mechanisms that nobody drew: random trees, random loops, and linkages whose mobility is known by other means."""

import math

import numpy as np
import pinocchio as pin
import pytest
from elementary import kleinfinger, values
from hand import DT, check
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from making import (
    PRISMATIC,
    REVOLUTE,
    TOOL,
    Body,
    Mechanism,
    axis,
    bennett,
    direction,
    graph,
    parallelograms,
    planar,
    platform,
    ring,
    sarrus,
    somewhere,
)

import cinegen
import raff2urdf
from raff2urdf.loops.mobility import analyse

SEEDS = st.integers(0, 2**32 - 1)
UNITS = {"um": 1e6, "mm": 1e3, "cm": 1e2, "m": 1.0}


def load(text: str) -> cinegen.Mechanism:
    return cinegen.load(f"RAFF any\n{text}")


def converted(text: str) -> int:
    """The mobility that the converter counts, without Pinocchio."""
    document = raff2urdf.loads(f"RAFF any\n{text}")
    return analyse(document, document.robot()).mobility


def loaded(mechanism: Mechanism, digits: int | None = 6) -> cinegen.Mechanism:
    """As a file that says so many digits of it; all of the geometry, where a rounded one could not be assembled."""
    overconstrained = len(mechanism.constraint_rows()) > np.count_nonzero(mechanism.singular_values() > 1e-6)
    return load(mechanism.text(digits=None if overconstrained else digits))


# --- trees -------------------------------------------------------------------------------------------------------


def random_tree(rng: np.random.Generator, unit: str) -> tuple[str, dict, dict]:
    """A RAFF text, and for each of its nodes the father, six numbers (m, rad) and the type (None: a frame)."""
    count = int(rng.integers(1, 14))
    numbers = [0, *(int(n) for n in rng.permutation(99)[:count] + 1)]
    nodes: dict[int, tuple[int, np.ndarray, int | None]] = {}
    blocks = []
    for i, number in enumerate(numbers):
        said = rng.normal(size=6) * [90.0, UNITS[unit], 90.0, UNITS[unit], 90.0, UNITS[unit]]
        said = np.where(rng.random(6) < 0.3, 0.0, np.round(said, int(rng.integers(0, 6))))
        metres = said / [1.0, UNITS[unit], 1.0, UNITS[unit], 1.0, UNITS[unit]]
        metres[[0, 2, 4]] = np.radians(said[[0, 2, 4]])
        words = list(zip(("gamma", "epsilon", "alpha", "d", "theta", "r"), said.tolist(), strict=True))
        rng.shuffle(words)
        parameters = " ".join(f"{word} {float(value)!r}" for word, value in words if float(value) or rng.random() < 0.5)
        kind = None if i == 0 else rng.choice(["frame", 0, 1, 2])
        pred = numbers[int(rng.integers(0, i))] if i else 0
        if i == 0:
            blocks.append(f"base {{ parameters {{ {parameters} }} }}")
        elif kind == "frame":
            blocks.append(f"frame {number} {{ pred {pred} parameters {{ {parameters} }} }}")
        else:
            blocks.append(f"link {number} {{ parameters {{ {parameters} }} type {kind} pred {pred} }}")
        nodes[number] = (pred, metres, None if kind in (None, "frame") else int(kind))
    rng.shuffle(blocks)
    text = f"units {unit}\nrobot r {{\n" + "\n".join(blocks) + "\n}\n"
    joints = {f"joint{n}": n for n, (_, _, kind) in nodes.items() if kind in (PRISMATIC, REVOLUTE)}
    return text, nodes, joints


@settings(max_examples=120)
@given(SEEDS, st.sampled_from(sorted(UNITS)))
def test_a_random_tree_stands_where_the_products_of_six_elementary_transforms_put_it(seed, unit):
    rng = np.random.default_rng(seed)
    text, nodes, joints = random_tree(rng, unit)
    mechanism = load(text)
    assert set(mechanism.joints) == set(joints)
    assert mechanism.mobility == len(joints)
    for turned in (False, True):
        q = mechanism.q_home
        if turned:
            q = mechanism.structure.checked(q + rng.normal(size=len(q)))
        named = values(mechanism, q)
        world: dict[int, np.ndarray] = {}

        def place(number: int, named=named, world=world) -> np.ndarray:
            if number not in world:
                pred, numbers, kind = nodes[number]
                numbers = numbers.copy()
                if kind in (PRISMATIC, REVOLUTE):
                    numbers[4 if kind == REVOLUTE else 5] = named[f"joint{number}"]
                world[number] = (np.eye(4) if number == 0 else place(pred)) @ kleinfinger(*numbers)
            return world[number]

        for number, (_, _, kind) in nodes.items():
            node = "base" if number == 0 else f"{'frame' if kind is None else 'link'}{number}"
            assert mechanism.placement(q, node).homogeneous == pytest.approx(place(number), abs=2e-12)


# --- loops -------------------------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(SEEDS)
def test_random_loops_leave_the_mobility_that_screw_theory_says(seed):
    """One to four loops, coupled or not, between links, frames and the base, closed as rigid, prismatic, revolute and
    ball; the file's numbers rounded wherever a rounded mechanism still can be assembled."""
    rng = np.random.default_rng(seed)
    loops = int(rng.integers(1, 5))
    mechanism = graph(rng, int(rng.integers(2, 7 * loops + 3)), loops)
    mobility = mechanism.mobility()
    assume(mobility is not None)
    if seed % 2:
        mechanism = mechanism.moved(somewhere(rng, 3.0))
    one = loaded(mechanism)
    assert one.closure(one.q_home) <= 1e-12
    assert one.mobility == mobility
    assert len(one.actuated) == mobility


@settings(max_examples=20)
@given(SEEDS)
def test_platforms_on_legs_have_the_mobility_of_gruebler_and_kutzbach(seed):
    """M = (freedoms of all joints) - 6 (legs - 1), for whatever legs, cut anywhere, in any unit, written with rounded
    numbers: generic geometry is never overconstrained."""
    rng = np.random.default_rng(seed)
    words = [
        ["UPS", "RUS", "PUS"],
        ["RRS", "PRS", "RPS"],
        ["SPS", "RSS", "UPS"],
        ["UPS", "RUS", "PUS", "RRS", "RPS", "RSR", "RRRRR", "UPU", "SPS", "UPRR"],
    ][int(rng.integers(4))]
    legs = [str(rng.choice(words)) for _ in range(int(rng.integers(2, 7)))]
    expected = sum({"R": 1, "P": 1, "U": 2, "S": 3}[letter] for word in legs for letter in word) - 6 * (len(legs) - 1)
    mechanism = platform(rng, legs, str(rng.choice(["rigid", "joint"])))
    assume(mechanism.mobility() == max(0, expected))  # not near a singularity
    one = loaded(mechanism, digits=5)
    assert one.closure(one.q_home) <= 1e-12
    assert one.mobility == max(0, expected)


@pytest.mark.parametrize("lean", [0.0, math.pi])
@pytest.mark.parametrize("cranks", [2, 3, 4])
def test_a_parallelogram_drawn_flat_has_one_freedom_however_many_cranks(lean, cranks):
    """Where all bars lie in one line it could also fold into an antiparallelogram; a third crank forbids that."""
    mechanism = parallelograms(np.random.default_rng(0), 1, cranks, lean)
    text = mechanism.text()
    assert load(text).mobility == 1
    assert converted(text) == 1


RINGS = {
    "Bennett": (bennett, 1),
    "Sarrus": (sarrus, 1),
    "planar four-bar": (lambda rng: planar(rng.normal(size=(4, 2))), 1),
    "spherical four-bar": (lambda rng: [axis(z, z) for z in (direction(rng) for _ in range(4))], 1),
    "spatial seven-bar": (lambda rng: [somewhere(rng) for _ in range(7)], 1),
}


@pytest.mark.parametrize(("body", "mobility"), [
    pytest.param("link 1 { parameters { alpha 30 d 100 theta 10 } type 2 pred 0 }"
        "link 2 { parameters { alpha 90 d 500 theta 20 } type 2 pred 1 } frame 3 { parameters { r 300 } pred 2 }"
        "frame 4 { parameters { alpha 90 d 500 r 300 } pred 1 } constraint { frame 3 frame 4 type 2 }", 2,
        id="a door on two hinges"),
    pytest.param("link 1 { parameters { d 100 theta 5 } type 2 pred 0 } frame 2 { parameters { d 100 } pred 0 }"
        "constraint { link 1 frame 2 type 2 }", 1, id="a single joint and its double"),
    pytest.param("link 1 { parameters { d 100 } type 2 pred 0 } link 2 { parameters { d 100 } type 2 pred 0 }"
        "constraint { link 1 link 2 } constraint { link 1 link 2 }", 1, id="the same loop twice"),
])  # fmt: skip
def test_small_and_odd_loops_are_counted_right(body, mobility):
    text = f"robot r {{ {body} }}"
    assert converted(text) == mobility
    mechanism = load(text)
    assert mechanism.mobility == mobility
    assert len(mechanism.actuated) == mobility
    end = mechanism.nodes[-1]
    assert mechanism.jacobian(mechanism.q_home, end).shape == (6, mechanism.model.nv)
    solver = cinegen.Solver(mechanism, DT)
    solver.add_task(end, translation=3, rotation=0).target.translation += 0.01
    for _ in range(20):
        before = solver.q.copy()
        check(mechanism, before, solver.step())


FIXED_LINK = "link 1 { parameters { d 100 } type 0 pred 0 }"


@pytest.mark.parametrize("body", [
    "",
    f"{FIXED_LINK} frame 2 {{ pred 1 }}",
    f"{FIXED_LINK} frame 2 {{ parameters {{ d 100 }} pred 0 }} constraint {{ link 1 frame 2 }}",
])  # fmt: skip
def test_robots_without_joints_stand_still(body):
    mechanism = load(f"robot r {{ {body} }}")
    solver = cinegen.Solver(mechanism, 0.01)
    solver.add_task(mechanism.nodes[-1]).target.translation += 1.0
    assert mechanism.mobility == len(solver.step().q) == 0
    assert mechanism.jacobian(mechanism.q_home, mechanism.nodes[-1]).shape == (6, 0)


# --- what does not matter ----------------------------------------------------------------------------------------


def tool_motions(mechanism: cinegen.Mechanism, q: np.ndarray) -> np.ndarray:
    """(6, 6) projector on the tool's twists that the loops leave, in the tool's frame, without unit."""
    motions = np.eye(mechanism.model.nv)
    if mechanism.is_constrained:
        motions = np.linalg.svd(mechanism.structure.system.evaluate(q)[1])[2][mechanism.loop_rank :].T
    twists = mechanism.jacobian(q, "tool") * mechanism.scale @ motions
    twists[:3] /= mechanism.length
    u, sigma, _ = np.linalg.svd(twists)
    u = u[:, : int(np.count_nonzero(sigma > 1e-7))]
    return u @ u.T


def moved(mechanism: cinegen.Mechanism, seed: int, far: float = 0.15) -> np.ndarray | None:
    """A closed configuration some way off home."""
    rng = np.random.default_rng(seed)
    _, sigma, vt = np.linalg.svd(mechanism.structure.system.evaluate(mechanism.q_home)[1])
    if mechanism.loop_rank and sigma[mechanism.loop_rank - 1] < 0.02:
        return None
    free = vt[mechanism.loop_rank :].T
    step = free @ rng.normal(size=free.shape[1])
    step *= far / np.abs(step).max()
    return mechanism.close(pin.integrate(mechanism.model, mechanism.q_home, step * mechanism.scale))


def reaches(mechanism: cinegen.Mechanism, target: pin.SE3) -> bool:
    """Whether the solver brings the tool there."""
    solver = cinegen.Solver(mechanism, dt=1.0)
    solver.add_task("tool", target)
    for _ in range(300):
        metres, angle = solver.step().errors[0]
        if max(metres / mechanism.length, angle) <= 1e-9:
            return True
    return False


def same_tool(one: cinegen.Mechanism, other: cinegen.Mechanism, place: np.ndarray, factor: float, seed: int) -> None:
    """Both move their tools alike: to first order at home, and as far as the first one's tool goes. The other one is
    `factor` times as large and stands at `place`."""
    assert one.mobility == other.mobility
    there = pin.SE3(place)

    def elsewhere(pose: pin.SE3) -> pin.SE3:
        return there * pin.SE3(pose.rotation, factor * pose.translation)

    at_home = elsewhere(one.placement(one.q_home, "tool"))
    assert other.placement(other.q_home, "tool").homogeneous == pytest.approx(at_home.homogeneous, abs=1e-9 * factor)
    if one.length * factor == pytest.approx(other.length, rel=1e-6):  # another tree has another length
        assert tool_motions(one, one.q_home) == pytest.approx(tool_motions(other, other.q_home), abs=1e-6)
    q = moved(one, seed)
    assume(q is not None)
    assert reaches(other, elsewhere(one.placement(q, "tool")))


def any_closed(rng: np.random.Generator) -> Mechanism:
    """A mechanism with loops and a tool."""
    makers = [
        lambda: platform(rng, ["UPS", "RUS", "PUS"], str(rng.choice(["rigid", "joint"]))),
        lambda: platform(rng, ["RPS", "RRS", "PRS"], "joint"),
        lambda: platform(rng, ["UPU"] * 3),
        lambda: parallelograms(rng, 3, 3),
        lambda: ring([somewhere(rng) for _ in range(8)], None, int(rng.integers(8))),
        lambda: ring(sarrus(rng), None, int(rng.integers(6))),
        lambda: ring(bennett(rng), None, int(rng.integers(4))),
        lambda: ring(planar(rng.normal(size=(6, 2)))),
    ]
    return makers[int(rng.integers(len(makers)))]()


def closed(seed: int) -> Mechanism:
    """Well away from singularities; its numbers are its own, not rounded."""
    mechanism = any_closed(np.random.default_rng(seed))
    sigma = mechanism.singular_values()
    assume(not ((sigma > 1e-9) & (sigma < 0.05)).any())
    return mechanism


def exactly(mechanism: Mechanism, units: str = "mm") -> cinegen.Mechanism:
    return load(mechanism.text(joint_digits=None, units=units))


@settings(max_examples=8)
@given(SEEDS)
def test_where_the_base_stands_does_not_matter(seed):
    mechanism, place = closed(seed), somewhere(np.random.default_rng(seed + 1), 2.0)
    same_tool(exactly(mechanism), exactly(mechanism.moved(place)), place, 1.0, seed)


@settings(max_examples=15)
@given(SEEDS)
def test_how_links_are_numbered_and_in_what_order_they_stand_does_not_matter(seed):
    mechanism, rng = closed(seed), np.random.default_rng(seed + 1)
    numbers = rng.permutation(900)[: len(mechanism.bodies)] + 1
    renamed = {body.number: int(n) for body, n in zip(mechanism.bodies, numbers, strict=True)}
    order = [int(i) for i in rng.permutation(len(mechanism.bodies))]
    other = exactly(mechanism.renumbered(renamed, order))
    one = exactly(mechanism)
    same_tool(one, other, np.eye(4), 1.0, seed)
    back = {f"joint{number}": f"joint{new}" for number, new in renamed.items()}
    assert {back[joint] for joint in one.joints} == set(other.joints)


@pytest.mark.parametrize("name", RINGS)
@settings(max_examples=4)
@given(seed=SEEDS)
def test_which_joint_was_cut_does_not_matter(name, seed):
    axes = RINGS[name][0](np.random.default_rng(seed))
    sigma = ring(axes).singular_values()
    assume(not ((sigma > 1e-9) & (sigma < 0.05)).any())
    one = exactly(ring(axes))
    assert one.mobility == RINGS[name][1]
    for cut in range(len(axes)):
        other = exactly(ring(axes, None, cut, ("joint", "rigid")[cut % 2]))
        assert other.closure(other.q_home) <= 1e-12
        same_tool(one, other, np.eye(4), 1.0, seed)


@settings(max_examples=15)
@given(SEEDS, st.sampled_from([1e-9, 1e-6, 1e-3, 1e3, 1e6]))
def test_a_robot_of_micrometres_moves_like_its_twin_of_metres(seed, factor):
    mechanism = closed(seed)
    one, other = exactly(mechanism), exactly(mechanism.scaled(factor), "um" if factor < 1.0 else "m")
    assert other.length == pytest.approx(factor * one.length, rel=1e-12)
    solvers = [cinegen.Solver(each, DT) for each in (one, other)]
    tasks = [solver.add_task("tool", rotation=0) for solver in solvers]
    rng = np.random.default_rng(seed)
    for tick in range(40):
        if tick % 20 == 0:
            away = rng.normal(size=3)
            for task, each in zip(tasks, (one, other), strict=True):
                task.target.translation = each.placement(each.q_home, "tool").translation + 0.3 * each.length * away
        steps = [solver.step() for solver in solvers]
        assert steps[0].status is steps[1].status
        assert steps[1].q / other.scale == pytest.approx(steps[0].q / one.scale, abs=1e-5)


# --- driving them ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("closed_to_a_ring", [False, True])
def test_chains_of_many_joints_load_close_and_follow(closed_to_a_ring):
    count, rng = 60, np.random.default_rng(60)
    around = np.linspace(0.0, 1.8 * math.pi, count)
    axes = [axis((math.cos(t), math.sin(t), 0.1 * t), direction(rng)) for t in around]
    if closed_to_a_ring:
        mechanism = loaded(ring(axes))
        assert mechanism.mobility == count - 6
    else:
        bodies = [Body(i + 1, i, place) for i, place in enumerate(axes)]
        mechanism = loaded(Mechanism((*bodies, Body(TOOL, count, axes[-1], None, 'name "tool"'))))
        assert mechanism.mobility == count
    goal = mechanism.placement(mechanism.q_home, "tool")
    goal.translation = goal.translation + np.array([0.1, 0.2, 0.1])
    assert reaches(mechanism, goal)
