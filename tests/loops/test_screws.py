"""Characteristic length and singular values belong to the mechanism: not to frames, cuts or order."""

import math
from collections import deque
from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest
from elementary import ROBOTS
from loop_openings import pin_screws

import cinegen
from cinegen.ik.batch import BatchEvaluator
from cinegen.ik.singular_values import passive_singular_values
from cinegen.joints import supporting_columns
from cinegen.loops.closed_loops import ClosedLoops, LoopConstraint
from cinegen.loops.motions import motions_of
from cinegen.loops.screws import LoopScrews
from cinegen.singularities import SingularityType, singularity
from raff2urdf.closure import rank
from raff2urdf.loops.length import characteristic_length
from raff2urdf.raff.document import LoopKind

KINDS = {
    LoopKind.REVOLUTE: pin.JointModelRZ,
    LoopKind.PRISMATIC: pin.JointModelPZ,
    LoopKind.BALL: pin.JointModelSpherical,
}


class Joint(NamedTuple):
    """Of a mechanism: two bodies, and where it is in the world at home."""

    kind: LoopKind
    first: int
    other: int
    place: pin.SE3


class Form(NamedTuple):
    """A description of a mechanism: its loops, and the carrier of each body."""

    system: ClosedLoops
    carriers: dict[int, int]
    q: np.ndarray

    @property
    def length(self) -> float:
        self.system.evaluate(self.q)
        points = np.array([placement.translation for placement in self.system.data.oMi])
        model, screws = self.system.model, self.system.screws()
        moves = np.zeros((len(points), screws.shape[1]), dtype=bool)
        for j in range(1, model.njoints):
            moves[j, : model.nv] = supporting_columns(model, j) > 0.0
        return characteristic_length(screws, points, moves)

    def loops(self, q: np.ndarray) -> np.ndarray:
        matrix = LoopScrews(self.system, self.q, np.zeros(0, dtype=int)).matrix(self.system, self.system.evaluate(q)[1])
        return np.linalg.svd(matrix, compute_uv=False)

    def task(self, q: np.ndarray, body: int, on: int, point: np.ndarray) -> np.ndarray:
        """Singular values of a body's motion relative to another one, of a point."""
        motions = motions_of(self.system, q, rank(self.system.evaluate(q)[1]))
        model, columns = self.system.model, np.asarray(self.system.data.J)
        of = [supporting_columns(model, self.carriers[b]) for b in (body, on)]
        twist = columns * (of[0] - of[1]) * self.system.scale
        twist[:3] += np.cross(twist[3:], point[:, None], axis=0)
        twist[:3] /= self.system.length
        return np.linalg.svd(twist @ motions, compute_uv=False)


def described(
    joints: list[Joint], root: int, order: list[int], rng: np.random.Generator, length: float = 1.0, size: float = 1.0
) -> Form:
    """A tree from a root, which takes joints in an order; all others are cut. Frames lie anywhere along axes."""
    model, carriers, places, loops = pin.Model(), {root: 0}, [pin.SE3.Identity()], []
    drawn = []
    for joint in joints:
        slide = pin.SE3(pin.utils.rotate("z", rng.uniform(-3.0, 3.0)), np.array([0.0, 0.0, size * rng.normal()]))
        turn = pin.SE3(pin.Quaternion(rng.normal(size=4)).normalized().matrix(), np.zeros(3))
        drawn.append(joint.place * (turn if joint.kind is LoopKind.BALL else slide))
    pending, used = deque([root]), set()
    while pending:
        body = pending.popleft()
        for i in order:
            kind, first, other, _ = joints[i]
            far = other if first == body else first
            if i in used or body not in (first, other) or far in carriers:
                continue
            used.add(i)
            parent = carriers[body]
            carriers[far] = model.addJoint(parent, KINDS[kind](), places[parent].actInv(drawn[i]), f"joint{i}")
            places.append(drawn[i])
            pending.append(far)
    for body, carrier in carriers.items():
        model.addFrame(pin.Frame(f"body{body}", carrier, 0, pin.SE3.Identity(), pin.FrameType.BODY))
    for i in order:
        if i not in used:
            kind, first, other, _ = joints[i]
            ends = [places[carriers[body]].actInv(drawn[i]) for body in (first, other)]
            loops.append(LoopConstraint(f"loop{i}", kind, f"body{first}", f"body{other}", *ends))
    return Form(ClosedLoops(model, loops, length), carriers, pin.neutral(model))


def random_mechanism(rng: np.random.Generator, size: float = 1.0) -> list[Joint]:
    """A chain of bodies with some more joints between them."""
    bodies, kinds = int(rng.integers(4, 8)), list(KINDS)
    pairs = [(i, i + 1) for i in range(bodies - 1)] + [(0, bodies - 1)]
    pairs += [tuple(rng.choice(bodies, 2, replace=False).tolist()) for _ in range(int(rng.integers(0, 3)))]
    turning = [LoopKind.REVOLUTE, LoopKind.BALL, LoopKind.REVOLUTE]  # else nothing but nodes gives a scale
    return [
        Joint(turning[i] if i < 3 else kinds[rng.choice(3, p=[0.6, 0.2, 0.2])], first, other,
              pin.SE3(pin.Quaternion(rng.normal(size=4)).normalized().matrix(), size * rng.normal(size=3)))
        for i, (first, other) in enumerate(pairs)
    ]  # fmt: skip


@pytest.mark.parametrize("seed", range(10))
def test_they_do_not_depend_on_frames_cuts_base_and_order(seed):
    rng = np.random.default_rng(seed)
    joints = random_mechanism(rng)
    bodies = 1 + max(max(joint.first, joint.other) for joint in joints)
    point, length = rng.normal(size=3), described(joints, 0, list(range(len(joints))), rng).length
    expected = None
    for root in [0, *rng.integers(bodies, size=4).tolist()]:
        form = described(joints, root, rng.permutation(len(joints)).tolist(), rng, length)
        assert form.length == pytest.approx(length, rel=1e-9)
        sigmas = form.loops(form.q), form.task(form.q, bodies - 2, 0, point)
        if expected is None:
            expected = sigmas
        for sigma, first in zip(sigmas, expected, strict=True):
            nonzero = min(np.count_nonzero(sigma > 1e-7), np.count_nonzero(first > 1e-7))
            assert sigma[:nonzero] == pytest.approx(first[:nonzero], abs=1e-9)
            assert max(sigma[nonzero:].max(initial=0.0), first[nonzero:].max(initial=0.0)) < 1e-7


@pytest.mark.parametrize("size", [1e-6, 1e-3, 1e3])
def test_the_length_is_proportional_to_size_and_singular_values_are_not(size):
    small, large = (random_mechanism(np.random.default_rng(3), s) for s in (1.0, size))
    order = list(range(len(small)))
    of_small, other = (
        described(joints, 0, order, np.random.default_rng(1), 1.0, s) for joints, s in ((small, 1.0), (large, size))
    )
    assert other.length == pytest.approx(size * of_small.length, rel=1e-9)
    forms = [
        described(joints, 0, order, np.random.default_rng(1), form.length, s)
        for joints, form, s in ((small, of_small, 1.0), (large, other, size))
    ]
    assert forms[0].loops(forms[0].q) == pytest.approx(forms[1].loops(forms[1].q), abs=1e-9)


def test_axes_that_nearly_meet_give_no_scale_and_small_changes_change_little():
    """A wrist: its tool is the scale, whether axes miss each other by 10 micrometres or not."""
    places = [pin.SE3(pin.utils.rotate(axis, 0.5 * np.pi), np.zeros(3)) for axis in "xyz"]
    tool = np.array([0.0, 0.0, 0.1])

    def length(off: float) -> float:
        screws = []
        for k, place in enumerate(places):
            axis, point = place.rotation[:, 2], off * np.eye(3)[(k + 1) % 3]
            screws.append(np.concatenate([np.cross(point, axis), axis]))
        return characteristic_length(
            np.array(screws).T, np.array([np.zeros(3), tool]), np.array([[0, 0, 0], [1, 1, 1]]) > 0
        )

    assert length(0.0) == pytest.approx(0.1)
    assert length(1e-5) == pytest.approx(0.1, rel=1e-3)
    offsets = np.geomspace(1e-6, 0.1, 200)
    lengths = np.array([length(off) for off in offsets])
    assert (np.abs(np.diff(np.log(lengths))) < 3.0 * np.diff(np.log(offsets))).all()
    assert lengths[-1] < 0.3


@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-8, 1e-5, 1e-3])
def test_axes_that_are_nearly_parallel_have_the_length_of_parallel_ones(tilt):
    rng = np.random.default_rng(0)
    points, directions = rng.normal(size=(5, 3)), tilt * rng.normal(size=(5, 3)) + [0.0, 0.0, 1.0]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    screws = np.vstack([np.cross(points, directions).T, directions.T])
    exact = np.sqrt(3.0 * ((points[:, :2] - points[:, :2].mean(axis=0)) ** 2).sum() / 5.0)
    length = characteristic_length(screws, points, np.zeros((5, 5), dtype=bool))
    assert length == pytest.approx(exact, rel=10.0 * tilt + 1e-9)


def test_the_characteristic_length_of_a_bar_on_a_hinge_is_that_of_the_bar(raff):
    bar = raff('robot r { base { } link 1 { type 2 pred 0 } frame 2 { parameters { d 300 } pred 1 name "tool" } }')
    assert bar.length == pytest.approx(0.3)


# --- robots of the repository ----------------------------------------------------------------------------------------


def test_a_four_bar_has_those_of_its_closed_form(robot):
    bar = robot("four_bar")
    for q in [bar.q_home, *bar.random_closed(5, seed=2)]:
        now, home = (
            np.array([bar.placement(at, node).translation[:2] for node in ("link1", "link2", "link3", "frame4")])
            for at in (q, bar.q_home)
        )
        values = np.linalg.svd(pin_screws(now, home), compute_uv=False)
        assert bar.loop_singular_values(q) == pytest.approx(values, abs=1e-12)
        assert bar.length == pytest.approx(math.sqrt(3.0 * ((home - home.mean(axis=0)) ** 2).sum() / 4.0))
    assert bar.length == pytest.approx(0.36128, abs=5e-6)
    assert bar.loop_singular_values(bar.q_home) == pytest.approx([2.0, 1.8235, 0.8215], abs=5e-5)


# --- couplings -------------------------------------------------------------------------------------------------------

# of a 3-4-5 polynomial cam: a rise of 20 mm in 10 degrees
CAM = "polynomial ( 0 0 0.2 -0.03 0.0012 )"
LOCKED = {
    "cam": f"link 2 {{ type 1 pred 0 parameters {{ r 10 }} limits {{ 0 20 }} }} coupling {{ link 2 link 1 {CAM} }}",
    "gears": """link 2 { type 2 pred 0 } coupling { link 2 link 1 ratio 0.0001 }
        link 3 { type 2 pred 0 } coupling { link 3 link 1 ratio 1 }""",
    "train": """link 2 { type 2 pred 0 } coupling { link 2 link 1 ratio 50 }
        link 3 { type 2 pred 0 } coupling { link 3 link 2 ratio 50 }""",
    "screw": """link 2 { type 1 pred 0 } coupling { link 2 link 1 lead 20 }
        link 3 { type 2 pred 2 } coupling { link 3 link 1 ratio 0.5 link 2 radius 1 }""",
}


@pytest.mark.parametrize("name", LOCKED)
def test_a_locked_joint_holds_its_followers_whatever_the_ratios_are(raff, name):
    """No follower moves, as each is a function of the locked joint: the passive motions are mapped to themselves."""
    motor = "link 1 { type 2 pred 0 parameters { theta 5 } limits { 0 10 } actuated 1 }"
    mechanism = raff(f'robot r {{ {motor} {LOCKED[name]} frame 9 {{ name "tool" pred 2 parameters {{ d 50 }} }} }}')
    state = singularity(mechanism, mechanism.q_home)
    assert state.near is not SingularityType.TYPE_2
    assert state.second == pytest.approx(np.ones(len(mechanism.couplings)))


@pytest.mark.parametrize("ratio", [1.0, 100.0])
def test_shafts_between_gears_do_not_matter(robot, ratio):
    """The crank of a four-bar is held by a motor: directly, or by wheels on shafts."""
    text = (ROBOTS / "four_bar.raff").read_text().replace("actuated 1", "")
    shafts = f"""
        link 11 {{ type 2 pred 0 actuated 1 }} link 12 {{ type 2 pred 0 }}
        coupling {{ link 12 link 11 ratio {ratio} }} coupling {{ link 1 link 12 ratio {ratio} offset 50 }}
        frame 4"""
    mechanism, bar = cinegen.load(text.replace("frame 4", shafts, 1)), robot("four_bar")
    loop = bar.screw_matrix(bar.q_home)
    held = np.linalg.svd(np.vstack([loop, np.eye(1, loop.shape[1], bar.v_index("joint1"))]), compute_uv=False)
    assert passive_singular_values(mechanism, mechanism.q_home)[-1] == pytest.approx(held[3], abs=1e-7)


def test_a_cam_that_is_driven_by_its_follower_is_singular_where_that_dwells(raff):
    """The slope is 16 x^2 (1 - x)^2 of the steepest one, at the part x of the rise."""
    mechanism = raff(
        f"robot r {{ link 1 {{ type 2 pred 0 parameters {{ theta 5 }} limits {{ 0 10 }} }} link 2 {{ type 1 pred 0 "
        f"parameters {{ r 10 }} limits {{ 0 20 }} actuated 1 }} coupling {{ link 2 link 1 {CAM} }} }}"
    )
    x = np.linspace(0.05, 0.95, 7)
    q = np.array([mechanism.configuration({"joint1": np.radians(10.0 * a)}) for a in x])
    q[:, mechanism.q_index("joint2")] = 0.02 * (10.0 * x**3 - 15.0 * x**4 + 6.0 * x**5)
    expected = 16.0 * x**2 * (1.0 - x) ** 2
    compiled = BatchEvaluator(mechanism, mechanism.end, passive_sigma=True).at(q)
    assert compiled.closure == pytest.approx(np.zeros(7), abs=1e-12)
    assert compiled.passive_sigma == pytest.approx(expected, rel=1e-9)
    assert [singularity(mechanism, each).second[-1] for each in q] == pytest.approx(expected, rel=1e-9)
