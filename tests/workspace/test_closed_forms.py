"""Maps against inverse kinematics in closed form: every cell that is farther than a cell from a boundary is right."""

import math

import numpy as np
import pinocchio as pin
import pytest
from closed_forms import delta4, five_bar, rx90, within
from five_bar import two_bar_angles
from mapped import mapped, middles, over
from scipy.ndimage import label, maximum_filter, minimum_filter
from urdf_text import UrdfJoint, urdf_text

from cinegen.model.build import build
from cinegen.singularities import SingularityType
from cinegen.singularities.crossing import of_node
from cinegen.workspace import CellStatus, MapError, MapSpecification, make_map
from cinegen.workspace.loci import loci
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
    assert arms.radius((0.0, 1.0, 0.0)) == pytest.approx(math.hypot(0.15, 1.0) + elbow[1], abs=1e-8)
    assert arms.interval(0) == pytest.approx((0.15 - elbow[1], elbow[1] - 0.15), abs=1e-8)
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


# --- cells ------------------------------------------------------------------------------------------------------------
# How cells come to their configurations: on home's branch, and none is lost for the way that was taken.


FLOATING = urdf_text([
    UrdfJoint("free", "world", "base", kind="floating"),
    UrdfJoint("slide", "base", "a", axis="1 0 0", kind="prismatic", limit=(-1.0, 1.0)),
    UrdfJoint("turn", "a", "tool", "0 0 0.3", "0 1 0", limit=(-1.0, 1.0)),
])  # fmt: skip


def test_over_motors_no_cell_is_lost_in_a_pocket_that_the_way_led_into(robot):
    """Each cell on its own straight way from home is the least that a whole piece must hold."""
    axes = (("joint1", -2.5, 2.5, 10), ("joint6", -2.5, 2.5, 10))
    spec = MapSpecification(robot("delta4"), over(*axes), ("sigma_1",))
    together, alone = mapped(spec), mapped(spec, most=1)
    assert (together["reachable"] >= alone["reachable"]).all()
    assert together["reachable"].sum() <= 1.1 * alone["reachable"].sum()
    model, q = robot("delta4").model, together["configuration"][together["reachable"]]
    assert (q >= model.lowerPositionLimit - 1e-8).all()
    assert (q <= model.upperPositionLimit + 1e-8).all()


@pytest.mark.parametrize("count", [35, 36])
def test_a_wave_does_not_change_branches_in_a_cell_where_two_meet(robot, count):
    """With odd counts a cell of this grid is exactly where both arms of the five-bar are folded."""
    five_bar = robot("five_bar")
    region = over(("x", -0.7, 0.7, count), ("y", -0.7, 0.7, count))
    spec = MapSpecification(five_bar, region, ("sigma_1",), limits=False)
    layers = mapped(spec)
    q = layers["configuration"][layers["reachable"] & (layers["sigma_1"] > 1e-3)]
    for joint in ("joint2", "joint4"):
        at = five_bar.q_index(joint)
        assert (np.sign(np.sin(q[:, at])) == np.sign(np.sin(five_bar.q_home[at]))).all()


@pytest.mark.parametrize(("names", "count"), [(("joint1", "joint2"), 20), (("joint2", "joint3"), 21)])
def test_a_curve_on_the_middles_or_the_borders_of_cells_is_one_line(robot, tmp_path, names, count):
    """An arm whose elbow is straight, over a range with that in its middle: at a point of the grid, or between two."""
    spec = MapSpecification(robot("planar_3r"), over(*((name, -1.0, 1.0, count) for name in names)), ("sigma_1",))
    curves = loci(make_map(spec, tmp_path / "map.zarr", workers=1), spec)
    (curve,) = [curve for curve in curves if curve.kind is SingularityType.TYPE_1]
    assert len(curve.points) == count
    np.testing.assert_allclose(curve.points[:, names.index("joint2")], 0.0, atol=1e-6)


def test_a_base_that_floats_rests(tmp_path):
    flying = build(FLOATING, None)
    assert flying.floating
    of_motors = mapped(MapSpecification(flying, over(("slide", -0.5, 0.5, 5), ("turn", -0.5, 0.5, 5)), node="tool"))
    assert np.isfinite(of_motors["sigma_1"]).all()
    region = over(("x", -1.5, 1.5, 9), ("ry", -0.5, 0.5, 3))
    layers = mapped(MapSpecification(flying, region, ("solutions", "sigma_1"), node="tool"))
    within = np.abs(region.axes[0].middles()) <= 1.0
    np.testing.assert_array_equal(layers["solutions"], np.repeat(within[:, None], 3, axis=1).astype(int))
    spec = MapSpecification(flying, over(("slide", -0.5, 0.5, 5), ("turn", -0.5, 0.5, 5)), ("sigma_1",), node="tool")
    assert loci(make_map(spec, tmp_path / "map.zarr", workers=1), spec) == ()
    rows = of_node(flying, "tool", 6)(flying.q_home)
    assert np.linalg.matrix_rank(rows) == 2
    with pytest.raises(MapError, match="can't move along y"):
        MapSpecification(flying, over(("y", -1.0, 1.0, 3)), node="tool")


def test_the_codes_of_stored_maps_stay():
    """Maps on disk hold these numbers."""
    codes = [
        CellStatus.NOT_EVALUATED, CellStatus.REACHABLE, CellStatus.REACHABLE_BY_SEARCH, CellStatus.UNREACHABLE_PROVED,
        CellStatus.UNREACHABLE_NOT_FOUND, CellStatus.LOOPS_OPEN, CellStatus.BEYOND_LIMITS,
    ]  # fmt: skip
    assert [int(code) for code in codes] == list(range(7)) == [int(code) for code in CellStatus]
    assert [code.reachable for code in codes] == [False, True, True, False, False, False, False]
    assert len({code.label for code in codes}) == 7
