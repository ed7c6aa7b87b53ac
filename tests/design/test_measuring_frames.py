"""Devices that stand anywhere, and targets that are fixed anywhere on a node: where they are is estimated, too."""

import numpy as np
import pinocchio as pin
import pytest
from calibration_data import POSE, errors_of, everything, noisy

import cinegen
from cinegen.design import Design, DesignError, Measurements, Parameters, calibrate
from cinegen.design.calibration.frames import MeasuringFrames
from cinegen.design.calibration.observation import Observation
from cinegen.design.poses import random_poses
from cinegen.errors import CinegenWarning

TRACKER = pin.SE3(pin.rpy.rpyToMatrix(0.4, -0.7, 2.5), np.array([2.5, -1.8, 0.9]))
BALL = pin.SE3(pin.rpy.rpyToMatrix(0.5, 0.3, -1.0), np.array([0.06, -0.03, 0.08]))
NOISE = {"m": 5e-5, "deg": float(np.radians(0.01))}


def read_by_tracker(
    parameters: Parameters, columns: list[str], truth: np.ndarray, poses: int = 40, seed: int = 1
) -> Measurements:
    """Return what a robot with true values (parameters,) reads without noise: the actuated joints, then columns."""
    mechanism = parameters.mechanism
    q = random_poses(Design(parameters), poses, seed)
    joints = [q[:, mechanism.q_index(joint)] for joint in mechanism.actuated]
    values = np.column_stack([*joints, np.zeros((poses, len(columns)))])
    headers = [*mechanism.actuated, *columns]
    blank = Measurements.of(mechanism, headers, values, [0.0] * len(joints) + [1.0] * len(columns))
    frames = MeasuringFrames(blank.quantities)
    places = {"tracker": TRACKER, "ball": BALL}
    frames.start = {name: places[name].homogeneous for name in frames.start}
    observation = Observation(parameters, blank, frames=frames)
    theta = np.append(truth, np.zeros(len(frames)))
    values[:, observation.outputs] = observation.predict(theta, derivatives=False).values
    noise = [NOISE[one.dimension.default] for one in blank.quantities[len(joints) :]]
    return Measurements.of(mechanism, headers, values, [0.0] * len(joints) + noise)


def test_readings_of_a_device_by_rigid_motions():
    """And derivatives by differences, away from the start of the rotation vectors."""
    parameters = Parameters("arm7", ["link3.r"])
    columns = [f"tool(ball).{c} @ tracker" for c in POSE]
    columns += ["tool(0 0 50mm).distance(1 0 0) @ tracker", "link4(10mm 0 0).along(1 1 2) @ tracker", "link5.x"]
    readings = read_by_tracker(parameters, columns, parameters.values, 4)
    mechanism = parameters.mechanism
    observation = Observation(parameters, readings)
    observation.frames.start = {"tracker": TRACKER.homogeneous, "ball": BALL.homogeneous}
    observation._is_placed = True
    here = observation.predict(observation.values)
    for q, row in zip(here.q, here.values, strict=True):
        seen = TRACKER.actInv(mechanism.placement(q, "tool") * BALL)
        np.testing.assert_allclose(row[:3], seen.translation, atol=1e-12)
        np.testing.assert_allclose(row[3:6], pin.rpy.matrixToRpy(seen.rotation), atol=1e-12)
        tip = TRACKER.actInv(mechanism.placement(q, "tool")).act(np.array([0.0, 0.0, 0.05]))
        np.testing.assert_allclose(row[6], np.linalg.norm(tip - [1.0, 0.0, 0.0]), atol=1e-12)
        point = TRACKER.actInv(mechanism.placement(q, "link4")).act(np.array([0.01, 0.0, 0.0]))
        np.testing.assert_allclose(row[7], point @ [1.0, 1.0, 2.0] / np.sqrt(6.0), atol=1e-12)
        np.testing.assert_allclose(row[8], mechanism.placement(q, "link5").translation[0], atol=1e-12)
    theta = observation.values + np.append([1e-3], 0.2 * np.random.default_rng(0).normal(size=12))
    here = observation.predict(theta)
    for k, name in enumerate(observation.names):
        ends = [observation.predict(theta + step * np.eye(13)[k], derivatives=False).values for step in (1e-6, -1e-6)]
        np.testing.assert_allclose(here.jacobian[:, :, k], (ends[0] - ends[1]) / 2e-6, atol=2e-9, err_msg=name)


def test_a_tracker_and_its_target_are_found():
    """Lengths of an arm from the positions of a ball, two of whose readings are wrong by a metre."""
    parameters = Parameters("arm7", ["link3.r", "link4.d", "link5.r"])
    truth = parameters.with_changed({"link3.r": parameters.values[0] + 4e-4, "link5.r": parameters.values[2] - 6e-4})
    readings = noisy(read_by_tracker(parameters, [f"tool(ball).{c} @ tracker" for c in "xyz"], truth), 2)
    readings.values[3, 7] += 1.0
    readings.values[17, 9] -= 1.0
    found = calibrate(parameters, readings, folds=0)
    assert found.subspace.rank == len(found.names) == 3 + 6 + 3
    assert (np.abs(found.values[:3] - truth) < 4.0 * found.sigmas[:3]).all()
    assert {(one.pose, one.column) for one in found.outliers} == {(3, 7), (17, 9)}
    device, ball = pin.SE3(found.frames["tracker"]), found.frames["ball"]
    sigma = found.sigmas[3:]
    off = device * TRACKER.inverse()
    assert (np.abs(pin.log3(off.rotation)) < 4.0 * sigma[3:6]).all()
    assert (np.abs(device.translation - TRACKER.translation) < 4.0 * sigma[:3]).all()
    assert (np.abs(ball[:3, 3] - BALL.translation) < 4.0 * sigma[6:]).all()
    assert sigma.max() < 2e-4


def test_where_the_robot_stands_is_not_told_from_where_the_device_stands():
    """Each combination that is determined without a device's frame remains so, and six motions of the robot and the
    device together change nothing."""
    parameters, rank = everything("delta4"), 42
    truth = parameters.values + errors_of(parameters) * np.random.default_rng(4).normal(size=len(parameters))
    # the platform does not rotate: a ball on it can't be found
    columns = [f"platform({'ball' if c in POSE[3:] else '60mm -30mm 80mm'}).{c} @ tracker" for c in POSE]
    readings = noisy(read_by_tracker(parameters, columns, truth), 3)
    found = calibrate(parameters, readings)
    assert not found.outliers
    assert found.subspace.rank == rank
    assert 0.8 < found.fit < 1.25
    for one in found.held_out:
        assert one.noise < one.after < 2.0 * one.noise
    named = [one for one in found.dependencies if one.text.startswith("robot and tracker move together as one body: ")]
    assert len(named) >= 4
    tracker = [f"tracker.{c}" for c in POSE]
    moved = [
        [dict(zip(one.names, change, strict=True)).get(component, 0.0) for component in tracker]
        for one in found.dependencies
        for change in one.changes
    ]
    assert np.linalg.matrix_rank(moved, tol=1e-6) == 6
    counted = rank + len(found.without_effect) + sum(len(one.changes) for one in found.dependencies)
    assert counted == len(found.names)
    observation = found.observation
    for one in found.dependencies:
        at = [found.names.index(n) for n in one.names]
        for change in one.changes:
            step = np.zeros(len(found.names))
            step[at] = 0.01 * change
            ends = [observation.predict(observation.values + s * step, derivatives=False).values for s in (1, -1)]
            assert np.abs(ends[0] - ends[1]).max() < 1e-5 * 0.01 * np.abs(change).max()


def test_targets_on_nodes_that_do_not_rotate_are_told():
    for name, message in (("delta4", "platform hardly rotates in these"), ("five_bar", "but about one axis in these")):
        parameters = Parameters(name, ["link2.d"])
        columns = [f"{parameters.mechanism.end}(ball).{c} @ tracker" for c in "xyz"]
        readings = read_by_tracker(parameters, columns, parameters.values, 12)
        with pytest.warns(CinegenWarning, match=message):
            calibrate(parameters, readings, folds=0)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (["tool.x @ tool"], "'tool' is a part of"),
        (["tool(joint1).x"], "'joint1' is a part of"),
        (["tool(ball).x", "link3(ball).y"], "the target 'ball' is on tool, too"),
        (["tool(tracker).x @ tracker"], "the target 'tracker' is a device, too"),
        (["joint1 @ tracker"], "'joint1 @ tracker' is neither a joint"),
    ],
)
def test_names_that_mean_two_things(columns, message):
    mechanism = cinegen.load("arm7")
    with pytest.raises(DesignError, match=message):
        MeasuringFrames(Measurements.of(mechanism, columns, np.zeros((1, len(columns))), 1e-4).quantities)


def test_positions_of_a_device_in_another_unit_are_asked_back():
    parameters = Parameters("arm7", ["link3.r"])
    columns = [f"tool.{c} @ tracker" for c in "xyz"]
    text = read_by_tracker(parameters, columns, parameters.values).text("m", "rad")
    for unit, meant, factor in (("mm", "m", "1000"), ("in", "mm", "0.03937")):
        scale = {"in": 1e3}.get(unit, 1.0)
        lines = [line.split(",") for line in text.replace("[m]", f"[{unit}]").splitlines()]
        for line in lines[2:]:
            line[-3:] = [f"{scale * float(cell):.9g}" for cell in line[-3:]]
        bad = Measurements.loads("\n".join(",".join(line) for line in lines), parameters.mechanism, "m.csv")
        told = f"m.csv: .* {factor} times as large: are they in {meant}, and read as {unit}"
        with pytest.raises(DesignError, match=told):
            calibrate(parameters, bad)
