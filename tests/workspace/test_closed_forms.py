"""Maps against inverse kinematics in closed form: every cell that is farther than a cell from a boundary is right."""

import math

import numpy as np
import pinocchio as pin
import pytest
from closed_forms import delta4, five_bar, planar_3r, rx90, within
from five_bar import two_bar_angles
from mapped import mapped, middles, over
from scipy.ndimage import label, maximum_filter, minimum_filter

from cinegen.workspace import CellStatus, MapError, MapSpecification
from cinegen.workspace.reach_bounds import ReachBounds


def agree(got, wanted, few=0.02):
    """Cells whose neighbours want the same are right; of the others few are not."""
    got, wanted = np.asarray(got, dtype=int), np.asarray(wanted, dtype=int)
    inner = maximum_filter(wanted, 3, mode="nearest") == minimum_filter(wanted, 3, mode="nearest")
    wrong = got != wanted
    assert not wrong[inner].any(), np.argwhere(wrong & inner)[:5]
    assert wrong[~inner].sum() <= few * max(1, (~inner).sum())
    assert wanted.any()
    assert not wanted.all()


def searched(cells):
    """Whoever is out of reach was looked for, or that is certain; there are configurations of all others alone."""
    status = cells["status"]
    assert np.isin(status[~cells["reachable"]], (CellStatus.UNREACHABLE_NOT_FOUND, CellStatus.UNREACHABLE_PROVED)).all()
    assert np.isin(status[cells["reachable"]], (CellStatus.REACHABLE, CellStatus.REACHABLE_BY_SEARCH)).all()
    assert (np.isfinite(cells["configuration"][..., 0]) == cells["reachable"]).all()


PLANE = ("x", -0.83, 0.81, 36), ("y", -0.83, 0.82, 36)


@pytest.mark.parametrize(("most", "limits"), [(10**6, True), (50, False)])
def test_five_bar_reaches_what_both_its_arms_reach_in_all_working_modes(robot, limits, most):
    region = over(*PLANE)
    layers = mapped(MapSpecification(robot("five_bar"), region, ("solutions",), limits=limits), most)
    agree(layers["solutions"], five_bar(*middles(region), limits))
    agree(layers["reachable"], five_bar(*middles(region), limits) > 0)
    searched(layers)


@pytest.mark.parametrize(("turned", "limits"), [(0.5, True), (-2.0, False)])
def test_planar_3r_reaches_an_annulus_about_where_its_last_link_begins(robot, limits, turned):
    region = over(("x", -1.01, 1.02, 36), ("y", -1.01, 1.03, 36), at={"rz": turned})
    layers = mapped(MapSpecification(robot("planar_3r"), region, ("solutions",), limits=limits))
    agree(layers["solutions"], planar_3r(*middles(region), turned, limits))
    agree(layers["reachable"], planar_3r(*middles(region), turned, limits) > 0)
    searched(layers)
    if not limits:
        x, y = middles(region)
        away = np.hypot(x - 0.2 * math.cos(turned), y - 0.2 * math.sin(turned))
        np.testing.assert_array_equal(layers["reachable"], (away >= 0.1) & (away <= 0.7))


@pytest.mark.parametrize(("counts", "most"), [((14, 13, 12), 60), ((7, 6, 5), 10**6)])
def test_delta4_s_working_volume_also_where_cells_are_large(robot, counts, most):
    lows, highs = (-5.0, -5.0, -6.0), (5.1, 5.2, 3.0)
    region = over(*zip("xyz", lows, highs, counts, strict=True))
    layers = mapped(MapSpecification(robot("delta4"), region, ()), most)
    agree(layers["reachable"], delta4(*middles(region)) > 0)
    searched(layers)


def test_delta4_has_one_solution_within_limits_and_eight_without(robot):
    region = over(("x", -5.0, 5.1, 14), ("y", -5.0, 5.2, 14), at={"z": -1.8, "rx": 0.0, "ry": 0.0, "rz": 0.0})
    for limits in (True, False):
        layers = mapped(MapSpecification(robot("delta4"), region, ("solutions",), limits=limits))
        wanted = delta4(*middles(region), -1.8, limits)
        assert wanted.max() == (1 if limits else 8)
        agree(layers["solutions"], wanted)


# --- other regions ---------------------------------------------------------------------------------------------------


def test_rx90_s_full_pose_at_a_fixed_orientation(robot):
    region = over(("x", -1.0, 1.0, 9), ("y", -1.0, 1.1, 9), ("z", -1.0, 1.0, 8), at={"rx": 0.4, "ry": 1.9, "rz": -0.3})
    layers = mapped(MapSpecification(robot("rx90"), region, ("solutions",)))
    points, rotations = region.poses(pin.SE3.Identity(), region.values((slice(None),) * 3))
    agree(layers["solutions"], rx90(points, rotations).reshape(region.shape))


# --- what is apart ---------------------------------------------------------------------------------------------------


def variant(raff, root, name, *changes):
    text = (root / f"robots/{name}.raff").read_text(encoding="utf-8").split("\n", 1)[1]
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    return raff(text)


def test_both_parts_are_found_where_limits_part_an_arm_s_poses(raff, root):
    arm = variant(
        raff, root, "planar_3r", ("theta 25.0", "theta 60.0"), ("theta 50.0", "theta 40.0"),
        ("theta -70.0", "theta 0.0"), ("{ -170.0 170.0 }", "{ -120.0 120.0 }"),
        ("{ -160.0 160.0 }\n    velocity 150", "{ -100.0 100.0 }\n    velocity 150"),
        ("{ -160.0 160.0 }\n    velocity 180", "{ -30.0 30.0 }\n    velocity 180"),
    )  # fmt: skip
    region = over(("x", -1.01, 1.02, 60), ("y", -1.01, 1.03, 60), at={"rz": math.pi})
    x, y = middles(region)
    wanted = np.zeros(region.shape, dtype=bool)
    for elbow in (1, -1):
        q1, q2, ok = two_bar_angles(x + 0.2, y, 0.4, 0.3, elbow)
        wanted |= ok & within(q1, -120, 120) & within(q2, -100, 100) & within(math.pi - q1 - q2, -30, 30)
    assert label(wanted)[1] == 2
    layers = mapped(MapSpecification(arm, region, ()), 100)
    agree(layers["reachable"], wanted)
    searched(layers)


# --- certainty -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["arm7", "gough", "hybrid"])
@pytest.mark.parametrize("limits", [True, False])
def test_what_a_robot_does_is_never_said_to_be_too_far(robot, name, limits):
    from cinegen.ik.local_ik import LocalIK

    mechanism = robot(name)
    some = LocalIK(mechanism, (), limits).samples(12, np.random.default_rng(1))
    for node in mechanism.nodes[1:]:
        placements = [mechanism.placement(q, node) for q in some]
        points, rotations = (np.array([getattr(p, part) for p in placements]) for part in ("translation", "rotation"))
        for rotation in (0, 2, 3):
            shells = ReachBounds(mechanism, node, limits, rotation)
            assert not shells.exclude(points, rotations).any(), (node, rotation)
            counted = rotations if rotation else np.eye(3)[None]  # what is not given makes no difference
            assert not shells.exclude(points, counted).any()


def test_what_is_too_far_is_so_by_chains_that_are_known(robot):
    """A shell for each leg of a gough; the annuli of both arms of a five-bar, whose elbows don't straighten."""
    gough_s = ReachBounds(robot("gough"), "platform", True, 3)
    np.testing.assert_allclose(gough_s.inner, 0.7, atol=1e-8)
    np.testing.assert_allclose(gough_s.outer, 1.3, atol=1e-8)
    arms = ReachBounds(robot("five_bar"), "tool")
    elbow = [math.sqrt(0.25**2 + 0.4**2 + 0.2 * math.cos(math.radians(bent))) for bent in (170.0, 5.0)]
    np.testing.assert_allclose(np.c_[arms.inner, arms.outer], [elbow, elbow], atol=1e-8)
    np.testing.assert_allclose(sorted(arms.centres[:, 0]), [-0.15, 0.15], atol=1e-12)
    free = ReachBounds(robot("gough"), "platform", False, 3)
    assert np.isinf(free.outer).all()  # jacks without limits


# --- motors ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("limits", "most"), [(True, 77), (False, 10**6)])
def test_five_bar_s_motors_close_it_on_home_s_side(robot, limits, most):
    region = over(("joint1", -math.pi, math.pi, 30), ("joint3", -math.pi, math.pi, 30))
    layers = mapped(MapSpecification(robot("five_bar"), region, (), limits=limits), most)
    left, right = middles(region)
    elbows = np.array([-0.3 + 0.25 * (np.cos(left) - np.cos(right)), 0.25 * (np.sin(left) - np.sin(right))])
    half, base = np.arccos(np.linalg.norm(elbows, axis=0) / 0.8), np.arctan2(*-elbows[::-1])
    shoulder = np.array([-0.15 + 0.25 * np.cos(left), 0.25 * np.sin(left)])
    tool = shoulder + 0.4 * np.array([np.cos(base + half), np.sin(base + half)])
    wanted = np.ones(region.shape, dtype=bool)
    if limits:
        two = base + half - left
        four = np.arctan2(tool[1] - 0.25 * np.sin(right), tool[0] - 0.15 - 0.25 * np.cos(right)) - right
        wanted = within(two, -170, -5) & within(four, 5, 170) & within(left + two - right - four, -175, -5)
        for motor, low, high in ((left, 60, 200), (right, -20, 120)):
            wanted &= (motor >= math.radians(low)) & (motor <= math.radians(high))
    np.testing.assert_array_equal(layers["reachable"], wanted)
    assert (layers["status"] == np.where(wanted, CellStatus.REACHABLE, CellStatus.BEYOND_LIMITS)).all()
    mechanism = robot("five_bar")
    for q, x, y in zip(layers["configuration"][wanted], tool[0][wanted], tool[1][wanted], strict=True):
        np.testing.assert_allclose(mechanism.placement(q, "tool").translation, [x, y, 0.0], atol=1e-9)


def test_motors_have_as_many_assembly_modes_as_two_circles_have_points_in_common(robot, raff, root):
    apart = ("d -150.0", "d -300.0"), ("d 150.0", "d 300.0"), ("theta 125.0", "theta 90"), ("theta 50.0", "theta 90")
    bars = variant(raff, root, "five_bar", *apart)
    region = over(("joint1", 0.0, math.pi, 9), ("joint3", 0.0, math.pi, 9))
    layers = mapped(MapSpecification(bars, region, ("solutions",), limits=False))
    left, right = middles(region)
    elbows = np.hypot(-0.6 + 0.25 * (np.cos(left) - np.cos(right)), 0.25 * (np.sin(left) - np.sin(right)))
    wanted = np.where(elbows < 0.8, 2, 0)
    assert set(np.unique(wanted)) == {0, 2}
    np.testing.assert_array_equal(layers["solutions"], wanted)
    np.testing.assert_array_equal(layers["reachable"], wanted > 0)
    assert (layers["status"][wanted == 0] == CellStatus.LOOPS_OPEN).all()


# --- the whole way ---------------------------------------------------------------------------------------------------


def test_a_region_out_of_reach_is_a_map_without_a_cell(robot):
    far = over(("x", 3.0, 4.0, 5), ("y", 3.0, 4.0, 5))
    layers = mapped(MapSpecification(robot("five_bar"), far, ("solutions", "sigma_1", "sigma_2", "velocity", "margin")))
    assert not layers["reachable"].any()
    assert (layers["status"] == CellStatus.UNREACHABLE_PROVED).all()
    assert (layers["solutions"] == 0).all()
    assert all(np.isnan(layers[name]).all() for name in ("sigma_1", "sigma_2", "velocity", "margin"))


@pytest.mark.parametrize(
    ("name", "region", "quantities", "more", "said"),
    [
        ("five_bar", over(("z", 0.0, 1.0, 3)), (), {}, "can't move along z"),
        ("five_bar", over(("x", 0.0, 1.0, 3)), ("sigma",), {}, "unknown quantity 'sigma'"),
        ("arm7", over(("x", 0.0, 1.0, 3)), ("solutions",), {}, "infinitely many solutions"),
        ("planar_3r", over(("x", 0.2, 0.6, 2), orientation="axis"), ("solutions",), {}, "infinitely many solutions"),
        ("rx90", over(("x", 0.0, 1.0, 3)), ("clearance",), {"scene": {"nonsense": 1}}, "scene can't be read"),
        ("rx90", over(("rx", 0.0, 1.0, 3)), ("solid_angle",), {}, "leave its orientation free"),
        ("rx90", over(("x", 0.0, 1.0, 3)), (), {"starts": -1}, "starts"),
        ("rx90", over(("x", 0.0, 1.0, 3)), (), {"directions": 0}, "directions"),
    ],
)
def test_what_makes_no_sense_is_said_before_anything_is_done(robot, name, region, quantities, more, said):
    with pytest.raises(MapError, match=said):
        MapSpecification(robot(name), region, quantities, **more)
