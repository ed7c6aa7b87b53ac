"""Certificates of assembly modes: against closed forms, and against Newton's method at 50 digits."""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pinocchio as pin
import pytest
from assembled import closings, home, nothing_beside, places
from flint import arb, ctx
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from linkages import delta, five_bar, hexapod, hinge, ring, three_legs, tripod
from making import bennett, sarrus
from mpmath import mp
from numpy.random import default_rng as rng
from small_robots import two_bars

import cinegen
from cinegen.assembly import assembly_modes
from cinegen.assembly.certify import EndEquations, LoopEquations, Unknowns
from cinegen.assembly.exact_tree import ExactAxis
from cinegen.joints import axis
from raff2urdf.raff.document import LoopKind

DIGITS = 50


# --- the yardstick: Newton's method in mpmath ---------------------------------------------------------------------


def orthonormal(placement: pin.SE3):
    """(4, 4) with a rotation that is exactly one: z, and then x, as the certificates' documentation has it."""
    x, _, z = (mp.matrix(column.tolist()) for column in placement.rotation.T)
    z = z / mp.norm(z)
    x = x - (x.T * z)[0] * z
    x = x / mp.norm(x)
    made = mp.eye(4)
    for j, column in enumerate((x, cross(z, x), z, mp.matrix(placement.translation.tolist()))):
        made[:3, j] = column
    return made


def cross(a, b):
    return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def moved(joint, value):
    """(4, 4) the displacement of a joint."""
    made, along = mp.eye(4), mp.matrix(axis(joint).tolist())
    along = along / mp.norm(along)
    if joint.shortname().startswith("JointModelP"):
        made[:3, 3] = along * value
        return made
    x, y, z = along
    k = mp.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    made[:3, :3] = mp.eye(3) + mp.sin(value) * k + (1 - mp.cos(value)) * (k * k)
    return made


def residual(mechanism, values):
    """All equations of all loops at the joints' values, by name: many more than are independent."""
    model, known = mechanism.model, {0: mp.eye(4)}
    for j in range(1, model.njoints):
        joint_frame = known[int(model.parents[j])] * orthonormal(model.jointPlacements[j])
        known[j] = joint_frame * moved(model.joints[j], values[model.names[j]])
    rows = []
    for loop in mechanism.loops:
        ends = []
        for node, placement in ((loop.first, loop.first_placement), (loop.second, loop.second_placement)):
            frame = model.frames[mechanism.frame_id(node)]
            ends.append(known[int(frame.parentJoint)] * orthonormal(frame.placement) * orthonormal(placement))
        relative = ends[0] ** -1 * ends[1]
        columns = {LoopKind.BALL: (), LoopKind.REVOLUTE: (2,)}.get(loop.kind, (0, 1, 2))
        rows += [relative[i, j] - int(i == j) for j in columns for i in range(3)]
        rows += [relative[i, 3] for i in range(2 if loop.kind is LoopKind.PRISMATIC else 3)]
    return mp.matrix(rows)


def refined(mechanism, actuated, q):
    """Values of the passive joints near q, to 50 digits, and what is left of the equations there."""
    values = {name: mp.mpf(float(q[mechanism.q_index(name)])) for name in mechanism.joints}
    values |= {name: mp.mpf(float(value)) for name, value in zip(mechanism.actuated, actuated, strict=True)}
    passive = [name for name in mechanism.joints if name not in mechanism.actuated]
    tiny = mp.mpf(10) ** -25
    for _ in range(4):
        errors = residual(mechanism, values)
        jacobian = mp.matrix(len(errors), len(passive))
        for k, name in enumerate(passive):
            jacobian[:, k] = (residual(mechanism, {**values, name: values[name] + tiny}) - errors) / tiny
        step = mp.lu_solve(jacobian, -errors)
        for k, name in enumerate(passive):
            values[name] += step[k]
    return values, max(abs(row) for row in residual(mechanism, values))


def assert_enclosed(modes):
    """Assert that a true solution is in the box of each certificate, and that no other mode is. Where equations are
    only bounded they are those across a plane: what solves the others solves them as well as may be."""
    m = modes.mechanism
    with mpmath.workdps(DIGITS):
        for q, certificate in zip(modes, modes.certificates, strict=True):
            if certificate is None:
                continue
            values, left = refined(m, modes.actuated, q)
            assert left <= max(1e-40, 2.0 * certificate.gap)
            assert distance(m, q, values) <= certificate.error < certificate.radius
            for other in modes:
                if other is not q:
                    assert distance(m, other, values) > certificate.error


def distance(m, q, values):
    """The largest distance of a passive joint, rad or characteristic lengths; angles modulo 2 pi."""
    worst = mp.mpf(0)
    for name in set(m.joints).difference(m.actuated):
        gap = mp.mpf(float(q[m.q_index(name)])) - values[name]
        gap = gap / m.length if m.is_prismatic(name) else (gap + mp.pi) % (2 * mp.pi) - mp.pi
        worst = max(worst, abs(gap))
    return worst


CLOSED_AS = {
    LoopKind.RIGID: five_bar, LoopKind.REVOLUTE: lambda r: five_bar(r, "joint"), LoopKind.BALL: tripod,
    LoopKind.PRISMATIC: lambda r: three_legs(r, "rRP", "joint"),
}  # fmt: skip


@pytest.mark.parametrize(
    "pose", [EndEquations(), EndEquations((0, 1), 1, 2), EndEquations((1, 2), 2, 1), EndEquations((0, 1, 2), 0)]
)
@pytest.mark.parametrize("kind", list(LoopKind))
def test_derivatives_are_those_of_the_equations(built, kind, pose):
    assert_derivatives(built(CLOSED_AS[kind](rng(0))), pose)


def test_derivatives_of_couplings_are_those_of_their_polynomials():
    coupling = "coupling { link 2 link 1 polynomial ( -1 0.1 ) offset 50 } frame 3"
    assert_derivatives(cinegen.load(two_bars().replace("frame 3", coupling)), EndEquations())


def assert_derivatives(m, pose):
    """At an open configuration, by differences in balls of 200 bits."""
    q = m.q_home + rng(1).normal(size=m.model.nq)
    frame, target = (pin.exp6(rng(k).normal(size=6)) for k in range(2))
    equations = LoopEquations(m, Unknowns(tuple(m.joints), 1, ()), q, pose=(m.end, frame, target, pose))
    with ctx.workprec(200):
        point, step = [arb(float(q[m.q_index(name)])) for name in m.joints], arb(10) ** -25
        at_point = equations.evaluate(point, True)
        for k in range(len(point)):
            at_step = equations.evaluate([x + step if i == k else x for i, x in enumerate(point)], False)
            for before, after, row in zip(at_point.residual, at_step.residual, at_point.jacobian, strict=True):
                assert abs(float((after - before) / step - row[k])) < 1e-15


# --- what is certified ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [pin.JointModelRevoluteUnaligned, pin.JointModelPrismaticUnaligned])
@pytest.mark.parametrize("seed", range(5))
def test_a_joint_about_an_oblique_axis_is_displaced_as_the_yardstick_has_it(kind, seed):
    *direction, value = rng(seed).normal(size=4).tolist()
    model, direction = pin.Model(), np.array(direction) / np.linalg.norm(direction)
    joint = model.joints[model.addJoint(0, kind(*direction), pin.SE3.Identity(), "")]
    with mp.workdps(DIGITS):
        exact, expected = ExactAxis(joint).step(arb(value)), moved(joint, mp.mpf(value))
    for i in range(4):
        for j in range(4):
            assert exact[i, j].overlaps(arb(mp.nstr(expected[i, j], DIGITS)))
            assert float(exact[i, j].rad()) < 1e-14


@pytest.mark.parametrize("name", ["gough", "hybrid"])
def test_all_modes_of_robots_are_certified(robot, name):
    modes = assembly_modes(robot(name))
    assert modes.certified == len(modes) > 1
    assert max(cert.error for cert in modes.certificates) < 1e-12
    assert min(cert.radius for cert in modes.certificates) >= 1e-8


MADE = {
    "five-bar": five_bar, "3-RPR": lambda r: three_legs(r, "RpR"), "3-RRR": lambda r: three_legs(r, "rRR"),
    "tripod": tripod, "delta": lambda r: delta(r)[0],
}  # fmt: skip


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(sorted(MADE)), st.integers(0, 10**6))
def test_the_solution_is_in_the_box(built, made, seed):
    """Of random mechanisms at random values of their actuated joints, near home."""
    m = built(MADE[made](rng(seed)))
    modes = assembly_modes(m, home(m) + 0.01 * rng(seed).normal(size=len(m.actuated)))
    assert modes.certified <= sum(count == 1 for count in modes.coincident)
    assert all(cert.gap < 1e-15 for cert in modes.certificates if cert)  # links are at heights that round differently
    assert_enclosed(modes)


def test_a_rod_that_rotates_about_itself_stays_where_it_is(built):
    """UpS legs have no such rotation, SpS legs have one each: fixed, it leaves isolated solutions."""
    m = built(hexapod(rng(0), "SpS"))
    modes = assembly_modes(m)
    assert modes.certified == len(modes) > 0
    assert modes.unknowns.rank == len(modes.unknowns.joints) - 6


@pytest.mark.parametrize(("axes", "count"), [(bennett, 1), (sarrus, 4)])
def test_equations_that_depend_by_design_are_bounded_and_counted(built, axes, count):
    """A Bennett linkage closes for the sake of its proportions, which rounded numbers do not quite have: nobody can
    prove that it closes. That is reported."""
    joints = [hinge(at[:3, 3], at[:3, 2], motor=k == 0) for k, at in enumerate(axes(rng(1)))]
    m = built(ring(joints))
    modes = assembly_modes(m)
    assert modes.certified == len(modes) == count
    assert modes.self_motions == ()  # it moves, but not with its actuated joint locked
    nothing_beside(modes, ["tool"])
    for cert in modes.certificates:
        assert cert.equations == len(joints) - 2
        assert cert.equations + cert.others <= 5
        assert cert.others > 0
        assert 0.0 < cert.gap < 1e-12
    assert "independent equations" in modes.certification


# --- what is not ----------------------------------------------------------------------------------------------------


def test_what_is_no_mode_is_not_certified(robot):
    for name in ("five_bar", "gough"):
        m = robot(name)
        modes = assembly_modes(m)
        passive = [m.q_index(joint) for joint in m.joints if joint not in m.actuated]
        for seed in range(2):
            off = np.zeros(m.model.nq)
            off[passive] = 1e-3 * rng(seed).normal(size=len(passive))
            assert replace(modes, configurations=tuple(q + off for q in modes)).certified == 0
            assert replace(modes, configurations=tuple(q + 1e3 * off for q in modes)).certified == 0
        assert replace(modes, actuated=modes.actuated + 1e-3).certified == 0
    # a rotation through pi does not close a rigid loop, though its equations are 0 there, too
    m = robot("five_bar")
    half = math.pi * (np.arange(m.model.nq) == m.q_index("joint5"))
    modes = assembly_modes(m)
    assert replace(modes, configurations=tuple(q + half for q in modes)).certified == 0


def test_a_mode_that_is_listed_twice_counts_once(robot):
    m = robot("gough")
    modes = assembly_modes(m)
    q = modes[0]
    twice = replace(modes, configurations=(q, q), coincident=(1, 1))
    assert twice.certified == 1
    # the same platform, with universal joints and balls written by other angles
    pose = places(m, q, [m.end])
    others = [o for o in closings(modes, 200) if np.abs(places(m, o, [m.end]) - pose).max() < 1e-9]
    others = [o for o in others if m.distance(o, q) > 0.1]
    assert others
    for other in others:
        assert replace(modes, configurations=(q, other), coincident=(1, 1)).certified == 1
