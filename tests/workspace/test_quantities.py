"""What maps tell of cells: against the study of single configurations, numpy, linear programmes and closed forms."""

import functools
import math
import re

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from clearings import ball, measured, obstacles_of
from closed_forms import rx90
from hypothesis import given
from hypothesis import strategies as st
from loop_openings import jacobian_by
from mapped import mapped, middles, over
from scipy.optimize import linprog
from urdf_text import UrdfJoint, urdf_text

import cinegen
from cinegen.collision.clearance import Clearance, links_of
from cinegen.model.build import build
from cinegen.singularities import singularity
from cinegen.workspace import MapError, MapSpecification, make_map
from cinegen.workspace.by_pose import fibonacci_sphere

SPECIFICATIONS = {
    "five_bar": over(("x", -0.5, 0.5, 6), ("y", -0.5, 0.5, 6)),
    "gough": over(("x", -0.3, 0.3, 5), ("rz", -0.3, 0.3, 5)),
    "rx90": over(("x", 0.2, 0.7, 4), ("z", -0.5, 0.6, 4), orientation="fixed"),
    "arm7": over(("x", -0.8, 0.8, 5), ("z", -0.4, 1.1, 5)),
    "hybrid": over(("x", -0.5, 0.5, 4), ("y", -0.5, 0.5, 4)),
}


def cells(spec):
    """Each cell that is reached: its configuration, and by quantity its value."""
    layers = mapped(spec)
    reached = layers["reachable"]
    assert reached.sum() > 3
    rows = zip(*(layers[name][reached] for name in spec.quantities), strict=True)
    values = [dict(zip(spec.quantities, row, strict=True)) for row in rows]
    return list(zip(layers["configuration"][reached], values, strict=True))


def loop_rows(mechanism, q):
    return mechanism.structure.system.evaluate(q)[1] if mechanism.is_constrained else np.zeros((0, mechanism.model.nv))


ALONG = {"five_bar": (0.6, 0.8, 0.0)}
SEVERAL = ("sigma_1", "sigma_2", "condition", "manipulability", "velocity", "force", "margin")


@pytest.mark.parametrize("name", SPECIFICATIONS)
def test_quantities_are_those_of_singularities_numpy_and_linear_programmes(robot, name):
    """The linear programmes are in all joints' velocities and all loops' forces, not in those of actuated joints."""
    mechanism, along = robot(name), ALONG.get(name, (0.48, 0.6, 0.64))
    spec = MapSpecification(mechanism, SPECIFICATIONS[name], SEVERAL, along=along)
    assert ("sigma_2" in spec.quantities) == bool(mechanism.structure.passive_rank)
    scale = mechanism.scale[[mechanism.v_index(joint) for joint in mechanism.actuated]]
    for q, values in cells(spec):
        studied = singularity(mechanism, q)
        if spec.counted == (3, 3) or spec._rank(6) == spec._rank(3):
            assert values["sigma_1"] == pytest.approx(studied.sigma[0], rel=1e-5, abs=1e-7)
        if mechanism.structure.passive_rank:
            assert values["sigma_2"] == pytest.approx(studied.sigma[1], rel=1e-5, abs=1e-7)
        units = np.repeat([1.0 / mechanism.length, 1.0], 3)[:, None]
        moved = units * jacobian_by(mechanism, q, spec.node, mechanism.actuated) * scale
        sigma = np.linalg.svd(moved[: sum(spec.counted)], compute_uv=False)[: spec.rank]
        assert values["condition"] == pytest.approx(sigma[0] / sigma[-1], rel=1e-4)
        assert values["manipulability"] == pytest.approx(np.prod(sigma), rel=1e-4, abs=1e-9)
        if not mechanism.is_constrained:
            assert values["sigma_1"] == pytest.approx(sigma[-1], rel=1e-4, abs=1e-7)
        assert values["velocity"] == pytest.approx(greatest_speed(mechanism, q, spec.node, along), rel=1e-4)
        assert values["force"] == pytest.approx(greatest_force(mechanism, q, spec.node, along), rel=1e-4)
        low, high = mechanism.model.lowerPositionLimit, mechanism.model.upperPositionLimit
        with np.errstate(invalid="ignore"):
            margins = 1.0 - np.abs(q - 0.5 * (low + high)) / (0.5 * (high - low))
        assert values["margin"] == pytest.approx(np.nanmin(margins), abs=1e-6)
        assert -1e-6 <= values["margin"] <= 1.0


# --- capability ------------------------------------------------------------------------------------------------------


def limits_of(mechanism, declared):
    """(nv,) what motors are allowed, 1 where nothing is said; without bound for joints that have no motor."""
    columns = [mechanism.v_index(name) for name in mechanism.actuated]
    limits = np.full(mechanism.model.nv, np.inf)
    limits[columns] = np.where((declared[columns] > 0.0) & (declared[columns] < 1e8), declared[columns], 1.0)
    return limits


def greatest_speed(mechanism, q, node, along):
    """m/s: of all joint velocities that keep the loops closed and motors within their limits."""
    limits = limits_of(mechanism, mechanism.model.upperVelocityLimit)
    rows = loop_rows(mechanism, q) / mechanism.scale
    in_node = mechanism.placement(q, node).rotation.T @ along
    best = linprog(
        -in_node @ mechanism.jacobian(q, node)[:3], A_eq=rows, b_eq=np.zeros(len(rows)), bounds=np.c_[-limits, limits],
        method="highs",
    )  # fmt: skip
    return -best.fun


def greatest_force(mechanism, q, node, along):
    """N: of all efforts of motors and loops that balance it; joints without a motor bear nothing."""
    limits = limits_of(mechanism, mechanism.model.upperEffortLimit)
    limits[np.isinf(limits)] = 0.0
    rows = loop_rows(mechanism, q) / mechanism.scale
    pushed = mechanism.jacobian(q, node)[:3].T @ (mechanism.placement(q, node).rotation.T @ along)
    bounds = [(0.0, None), *zip(-limits, limits, strict=True), *[(None, None)] * len(rows)]
    best = linprog(
        np.r_[-1.0, np.zeros(len(limits) + len(rows))], A_eq=np.c_[pushed, -np.eye(len(limits)), rows.T],
        b_eq=np.zeros(len(limits)), bounds=bounds, method="highs",
    )  # fmt: skip
    return -best.fun


@pytest.mark.parametrize("name", ["belt_five_bar", "differential_wrist"])
def test_speeds_and_forces_through_couplings_are_those_of_linear_programmes(robot, name):
    mechanism = robot(name)
    homes = [(joint, mechanism.q_home[mechanism.q_index(joint)]) for joint in mechanism.actuated]
    axes = ((joint, home - 0.05, home + 0.05, 2) for joint, home in homes)
    along = np.array([0.48, 0.6, 0.64])
    spec = MapSpecification(mechanism, over(*axes), ("velocity", "force"), along=tuple(along), limits=False)
    layers = mapped(spec)
    reached = layers["reachable"]
    rows = [layers[key][reached] for key in ("configuration", "velocity", "force")]
    assert reached.sum() >= 2
    for q, speed, force in zip(*rows, strict=True):
        assert speed == pytest.approx(greatest_speed(mechanism, q, spec.node, along), rel=1e-4)
        assert force == pytest.approx(greatest_force(mechanism, q, spec.node, along), rel=1e-4)


def test_where_the_actuated_joints_control_nothing_there_is_no_speed_no_force_and_nothing_is_stiff(robot):
    """A five-bar with its elbows in one point: the linear programme has no bound, and rounding is no figure."""
    five_bar, elbow = robot("five_bar"), math.atan2(-200.0, 150.0)
    axes = [(name, at - 1e-3, at + 1e-3, 1) for name, at in (("joint1", elbow), ("joint3", math.pi - elbow))]
    names = ("sigma_2", "condition", "manipulability", "velocity", "force", "reaction_force", "stiffness", "frequency")
    spec = MapSpecification(
        five_bar, over(*axes), names, limits=False, reaction="joint2", gravity=(0.0, -9.81, 0.0),
        stiffness=dict.fromkeys(five_bar.actuated, 1e3),
    )  # fmt: skip
    layers = mapped(spec)
    assert layers["reachable"].all()
    assert layers["sigma_2"].item() < 1e-7
    assert layers["condition"].item() == layers["reaction_force"].item() == math.inf
    assert layers["stiffness"].item() == layers["frequency"].item() == 0.0
    for name in ("manipulability", "velocity", "force"):
        assert math.isnan(layers[name].item())


# --- limits, directions, obstacles -----------------------------------------------------------------------------------


@pytest.mark.parametrize("limits", [True, False])
def test_a_wrist_points_everywhere_but_where_its_limits_forbid(robot, limits):
    """The directions of a wrist that bends by 120 degrees are caps about its forearm, one for each way of the arm."""
    region = over(("x", 0.1, 0.8, 4), at={"y": 0.1, "z": -0.3})
    spec = MapSpecification(robot("rx90"), region, ("solid_angle",), limits=limits, directions=80)
    angles = mapped(spec)["solid_angle"]
    if not limits:
        np.testing.assert_allclose(angles, 4.0 * math.pi, rtol=1e-6)
    turns = np.array([pin.Quaternion.FromTwoVectors(np.eye(3)[2], d).matrix() for d in fibonacci_sphere(80)])
    for x, angle in zip(*middles(region), angles, strict=True):
        points = np.tile([x, 0.1, -0.3], (80, 1))
        wanted = rx90(points, turns, limits, order=False).mean() * 4.0 * math.pi
        assert angle == pytest.approx(wanted, abs=1.01 * 4.0 * math.pi / 80)


def test_clearance_is_what_coal_measures_between_shapes(robot):
    point, size = [0.3, 0.3, 0.4], 0.15
    scene = {"goal": {"point": [0.4, 0.4, 0.4]}, "obstacle": [{"kind": "sphere", "radius": size, "point": point}]}
    mechanism = robot("arm7")
    spec = MapSpecification(mechanism, SPECIFICATIONS["arm7"], ("clearance",), scene=scene)
    bodies, pairs = links_of(mechanism)
    clearance = Clearance(mechanism, bodies, obstacles_of([ball(size, *point)]), pairs, np.inf)
    for q, values in cells(spec):
        assert values["clearance"] == pytest.approx(measured(clearance, q).min(), abs=1e-5)


def _sliding(name, links=None):
    return urdf_text([UrdfJoint(name, "base", "tool", axis="1 0 0", kind="prismatic", limit=(-1.0, 1.0))], links)


BALL = {"name": "ball", "kind": "sphere", "radius": 0.1, "point": [0.4, 0.0, 0.3]}


def test_clearance_is_of_shapes_that_lie_in_files_beside_the_robot(tmp_path):
    """What others describe names its meshes as seen from its folder: whoever makes the map finds them there."""
    trimesh.creation.box((0.1, 0.1, 0.4)).export(tmp_path / "bar.stl")
    link = '<collision><geometry><mesh filename="bar.stl"/></geometry></collision>'
    (tmp_path / "arm.urdf").write_text(_sliding("slide", {"tool": link}))
    arm = cinegen.load(tmp_path / "arm.urdf")
    scene = {"name": "ball", "goal": {"point": [0, 0, 0]}, "obstacle": [BALL]}
    spec = MapSpecification(arm, over(("x", -0.4, 0.2, 6)), ("clearance",), "tool", scene=scene)
    dataset = make_map(spec, tmp_path / "arm.zarr", workers=1)
    across, above = np.maximum(np.abs(dataset.x.values - 0.4) - 0.05, 0.0), 0.3 - 0.2
    np.testing.assert_allclose(dataset.clearance, np.hypot(across, above) - 0.1, atol=1e-5)


def test_a_robot_is_the_same_wherever_its_shapes_lie_and_another_if_it_moves_otherwise(robot, tmp_path):
    """RAFF's graphics become files whose paths differ from machine to machine: no number of a map depends on them."""
    source, region = robot("delta4").source, over(("x", -0.1, 0.1, 3))
    elsewhere = re.sub(r'filename="[^"]*/', 'filename="/elsewhere/', source.urdf)
    assert elsewhere != source.urdf
    moved = build(elsewhere, source.constraints, str(tmp_path), "another name")
    original, changed = (MapSpecification(mechanism, region) for mechanism in (robot("delta4"), moved))
    assert (original.text, original.robot_hash) == (changed.text, changed.robot_hash)
    source = robot("five_bar").source
    longer = build(source.urdf.replace("0.25", "0.26"), source.constraints)
    original, changed = (MapSpecification(mechanism, region) for mechanism in (robot("five_bar"), longer))
    assert original.robot_hash != changed.robot_hash


@functools.cache
def _slide(name):
    return build(_sliding(name), None)


@pytest.mark.parametrize("name", ["sigma_1", "left/elbow"])
def test_a_motor_whose_name_a_map_can_t_hold_is_refused(name):
    arm = _slide(name)
    with pytest.raises(MapError, match=f"the name of joint '{name}' .*: rename it"):
        MapSpecification(arm, over((name, -0.5, 0.5, 3)))
    assert MapSpecification(arm, over(("x", -0.5, 0.5, 3))).region.size == 3


@given(st.tuples(*(st.floats(-3.0, 3.0),) * 3).filter(lambda along: math.hypot(*along) > 0.01))
def test_what_is_written_of_a_survey_is_read_back_to_the_last_bit(along):
    spec = MapSpecification(_slide("slide"), over(("x", -0.5, 0.5, 3)), ("velocity",), along=along)
    again = MapSpecification.of_attributes(spec.attributes)
    assert again.text == spec.text
    assert MapSpecification(again.mechanism, again.region, again.quantities, along=again.along).text == spec.text
