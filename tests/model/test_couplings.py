"""Couplings: equations between joints, judged by numpy's polynomials, by finite differences and by MuJoCo."""

import numpy as np
import pytest
from coupled_robots import random_text, seeds
from hypothesis import example, given, settings
from numpy.polynomial import Polynomial
from quick_kernels import quick

import cinegen
import raff2urdf
from cinegen.loops._kernels import kinematics, residual
from cinegen.loops._kernels.memory import LoopMemory
from cinegen.loops.setup import set_up
from raff2urdf.coupling import Coupling, coupled_scales, followed


def lacks(mechanism: cinegen.Mechanism, q: np.ndarray) -> np.ndarray:
    """What the couplings lack at q, rad or m, by numpy's polynomials."""

    def lack(coupling: Coupling) -> float:
        terms = ((Polynomial([0.0, *c]), mechanism.q_index(joint)) for joint, c in coupling.terms.items())
        return sum(polynomial(q[at]) for polynomial, at in terms) - coupling.constant

    return np.array([lack(coupling) for coupling in mechanism.couplings])


@settings(max_examples=28)
@given(seeds)
@example(597426230)  # ratios that multiply to 300
def test_random_couplings_on_random_mechanisms(seed):
    """Mobility by counting: each coupling follows joints before it, so each removes one degree of freedom."""
    rng = np.random.default_rng(seed)
    text, couplings = random_text(rng)
    mechanism = cinegen.load(text)
    assert mechanism.mobility == len(mechanism.joints) - couplings
    followers = {coupling.follower for coupling in mechanism.couplings}
    assert set(mechanism.actuated) == set(mechanism.joints) - followers
    assert np.abs(lacks(mechanism, mechanism.q_home)).max() <= 1e-10
    memory = set_up(LoopMemory(), mechanism.structure.system, mechanism.cluster_ranks)
    q = mechanism.q_home + rng.normal(size=mechanism.model.nq)
    assert mechanism.loop_residual(q) == pytest.approx(lacks(mechanism, q), rel=1e-12, abs=1e-12)
    ends = [(lacks(mechanism, q + 1e-6 * unit), lacks(mechanism, q - 1e-6 * unit)) for unit in np.eye(len(q))]
    differences = [(ahead - behind) / 2e-6 for ahead, behind in ends]
    jacobian = mechanism.loop_jacobian(q)
    assert jacobian == pytest.approx(np.array(differences).T, rel=1e-6, abs=1e-6 * max(1.0, np.abs(jacobian).max()))
    c, rows = mechanism.structure.system.evaluate(q)
    quick(kinematics.evaluate)(memory, q)
    quick(residual.evaluate_loops)(memory, True)
    assert memory.residual == pytest.approx(c, abs=1e-13 * max(1.0, np.abs(c).max()))
    assert memory.jacobian == pytest.approx(rows, abs=1e-13 * max(1.0, np.abs(rows).max()))


@settings(max_examples=8)
@given(seeds)
def test_couplings_hold_at_every_tick(seed):
    mechanism = cinegen.load(random_text(np.random.default_rng(seed))[0])
    solver = cinegen.Solver(mechanism, 0.01)
    task = solver.add_task(mechanism.end)
    closed = mechanism.random_closed(8, seed % 1000)
    for tick in range(120):
        if tick % 20 == 0 and closed:
            task.target = mechanism.placement(closed[tick // 20 % len(closed)], mechanism.end)
        step = solver.step()
        assert step.closure <= 1e-10
        sizes = np.array(mechanism.structure.system.coupling_sizes)
        assert np.abs(lacks(mechanism, step.q) / sizes).max() <= 1e-10


def test_followers_move_first_and_chains_follow():
    couplings = [Coupling("a", {"y": (1.0,), "x": (-2.0,)}, 3.0), Coupling("b", {"z": (2.0,), "y": (1.0, 1.0)}, 0.0)]
    assert followed(couplings, {"x": 1.0, "y": 0.0, "z": 9.0}) == {"x": 1.0, "y": 5.0, "z": -15.0}
    assert followed(couplings[::-1], {"x": 1.0, "y": 0.0, "z": 9.0}) == {"x": 1.0, "y": 5.0, "z": -15.0}
    bent = Coupling("c", {"y": (0.0, 1.0), "x": (-1.0,)})
    assert followed([bent], {"x": 4.0, "y": 1.0}) == {"x": 4.0, "y": 1.0}  # closing decides between 2 and -2


def test_an_equation_is_shown_as_one_would_write_it():
    assert str(Coupling("a", {"y": (1.0,), "x": (-2.0, 0.5)}, 3.0)) == "y - 2 x + 0.5 x^2 = 3"
    assert str(Coupling("a", {"y": (-1.0,), "x": (1.0,)})) == "-y + x = 0"


@pytest.mark.parametrize("none", [1e9, np.inf, np.finfo(float).max])  # as a URDF, a SDF, and Pinocchio say it
def test_a_curve_counts_by_its_steepest_slope_in_its_limits(none):
    parabola = Coupling("a", {"y": (1.0,), "x": (0.0, -1.0)})
    for limits, steepest in (((-3.0, 2.0), 6.0), ((-1.0, none), 2.0), ((-none, -4.0), 10.0)):
        size = parabola.size({"x": 1.0, "y": 1.0}, {"x": limits, "y": (-none, none)})
        assert size == pytest.approx(np.hypot(1.0, steepest))


def test_a_joint_that_only_drives_others_counts_as_much_as_what_it_drives(robot):
    couplings = [Coupling("a", {"y": (1.0,), "x": (-0.01,)})]
    alone, unlimited = {"y": 1.0, "x": 1.0}, dict.fromkeys("xy", (-np.inf, np.inf))
    assert coupled_scales(couplings, alone, {"x"}, unlimited) == {"y": 1.0, "x": 100.0}
    assert coupled_scales(couplings, alone, set(), unlimited) == {"y": 1.0, "x": 1.0}
    scara = robot("scara")
    assert scara.scale[scara.v_index("joint3")] == pytest.approx(scara.length * 2.0 * np.pi / 0.02)
    assert scara.scale[scara.v_index("joint4")] == 1.0  # it turns the quill, too
    solver = cinegen.Solver(scara, 0.01)
    solver.add_task("tool")
    assert solver.step().singular_values.min() > 0.1  # by the plain angle of the nut it would be 0.009


@pytest.mark.parametrize("level", [0.0, 1e-9, 1e-6, 1e-3, 0.5])
def test_a_cam_that_is_nearly_level_at_zero_is_closed_as_exactly_as_others(level):
    """A lift of level theta + 0.01 theta^2 in mm and degrees, at 40 degrees: 0.8 mm for a degree there."""
    cam = cinegen.load(f"""RAFF Cam
robot cam {{
  link 1 {{ parameters {{ theta 40 }} type 2 pred 0 actuated 1 }}
  link 2 {{ parameters {{ d 100 r 16 }} type 1 pred 0 }}
  coupling {{ link 2 link 1 polynomial ( {level} 0.01 ) }}
}}
""")
    lift, lacking = cam.q_index("joint2"), np.array(cam.q_home)
    lacking[lift] += 1e-6
    assert cam.closure(lacking) > 1e-7  # rad or characteristic lengths
    assert cam.close(lacking, ["joint1"])[lift] == pytest.approx(1e-3 * (40.0 * level + 16.0), abs=1e-13)
    steepest = np.degrees(1.0) * 1e-3 * (level + 0.02 * np.degrees(1.0))  # m/rad, within 1 rad of 0
    assert cam.scale[cam.v_index("joint1")] == pytest.approx(max(1.0, cam.length / steepest))


def test_gears_are_what_their_textbooks_say(robot):
    gear = robot("planetary_gear")  # Willis: sun / carrier = 1 + 72 / 24
    motion = np.linalg.svd(gear.loop_jacobian(gear.q_home))[2][-1]
    by = dict(zip(gear.columns, motion, strict=True))
    assert by["joint1"] / by["joint2"] == pytest.approx(4.0)
    assert by["joint3"] / by["joint2"] == pytest.approx(-3.0)
    assert (gear.structure.system.rows, gear.loop_rank, gear.mobility) == (6, 4, 1)
    scara = robot("scara")  # one revolution of the screw nut lifts the quill by 20 mm, one of the spline nut lowers it
    turned = scara.configuration({"joint3": scara.q_home[scara.q_index("joint3")] + 2.0 * np.pi})
    up = scara.close(turned, ["joint3", "joint4"])
    assert up[scara.q_index("joint5")] == pytest.approx(-0.03)
    wrist = robot("differential_wrist")
    q = wrist.close(wrist.configuration({"joint1": 0.5, "joint2": 0.1}), ["joint1", "joint2"])
    assert [q[wrist.q_index(joint)] for joint in ("joint3", "joint4")] == pytest.approx([0.3, 0.2])


def test_couplings_that_contradict_each_other_are_named(tmp_path, text_file):
    text = """RAFF any
robot any {
  link 1 { type 2 pred 0 } link 2 { parameters { d 100 } type 2 pred 1 }
  coupling { name "one" link 2 link 1 ratio 2 }
  coupling { name "other" link 2 link 1 ratio 2 offset 10 }
}
"""
    with pytest.raises(cinegen.ClosureError, match=r"these loops and couplings remain open: 'one' \(coupling, 0.0"):
        cinegen.load(text)
    path = text_file("any.raff", text)
    with pytest.raises(raff2urdf.RaffError, match="these loops and couplings remain open: 'one'"):
        raff2urdf.convert(path, tmp_path)


@pytest.mark.parametrize("degrees", [3.0, 10.0])
def test_a_steep_cam_is_closed_as_exactly_as_gears(degrees):
    """A 3-4-5 polynomial, a rise of 20 mm: its highest power at 1 rad, far beyond its limits, does not count."""
    c = 20.0 * np.array([10.0, -15.0, 6.0]) / degrees ** np.array([3, 4, 5])
    cam = f"""
  link 1 {{ type 2 pred 0 parameters {{ theta {degrees / 2} }} limits {{ 0 {degrees} }} actuated 1 }}
  link 2 {{ type 1 pred 0 parameters {{ d 100 r 10 }} limits {{ 0 20 }} }}
  coupling {{ link 2 link 1 polynomial ( 0 0 {" ".join(map(str, c.tolist()))} ) }}"""
    second = cam.replace("link 1 ", "link 3 ").replace("link 2 ", "link 4 ")  # a cluster of its own
    mechanism = cinegen.load(f"RAFF r\nrobot r {{{second}{cam}\n}}")
    turned, lift = mechanism.q_index("joint1"), mechanism.q_index("joint2")
    start = np.array(mechanism.q_home)
    start[lift] += 1e-8
    for part in (0.2, 0.5, 0.7):
        start[turned] = np.radians(part * degrees)
        q = mechanism.close(start, ["joint1", "joint3"])
        assert q[lift] == pytest.approx(0.02 * (10.0 * part**3 - 15.0 * part**4 + 6.0 * part**5), abs=1e-13)
        lacking = q.copy()
        lacking[lift] += 1e-6
        assert mechanism.closure(lacking) > 1e-7  # rad or characteristic lengths
    parts = np.linspace(0.0, 1.0, 11)  # far from each other for a cam as steep as this
    at_cam = np.column_stack([np.full(11, np.radians(degrees / 2)), np.radians(degrees) * parts])
    lifts = cinegen.evaluate(mechanism, mechanism.end, at_cam).q[:, lift]
    assert lifts == pytest.approx(0.02 * (10.0 * parts**3 - 15.0 * parts**4 + 6.0 * parts**5), abs=1e-10)
    assert max(map(mechanism.closure, mechanism.random_closed(4))) < 1e-12
