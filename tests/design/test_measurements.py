"""CSV files of measurements: what they say, and what is wrong with them."""

import re
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from calibration_data import POSE, changed_by_dependencies, errors_of, everything, exact, noisy
from scipy.spatial.transform import Rotation

import cinegen
from cinegen.design import Design, DesignError, Measurements, Parameters, calibrate
from cinegen.design.calibration.checks import check
from cinegen.design.calibration.comparison import ColumnComparison
from cinegen.design.calibration.estimation import expected_errors
from cinegen.design.calibration.frames import MeasuringFrames
from cinegen.design.calibration.observation import Observation
from cinegen.errors import CinegenWarning

ROBOT = cinegen.load("five_bar")
HEADER = "pose, joint1 [deg], joint3 [deg], tool.x [mm], tool(0 0 50mm).distance(1000mm 0 0)\n"


def read(text: str) -> Measurements:
    return Measurements.loads(text, ROBOT, "m.csv")


def test_units_of_headers_and_cells():
    rows = "# tracker\nsigma,,,0.05,0.02mm\na,90,1.5rad,120,0.9\nb,80,70deg,0.2m,\nsigma,,,0.1,\nc,1,2,3,\n"
    table = read(HEADER + rows)
    assert table.labels == ("a", "b", "c")
    np.testing.assert_allclose(table.values[:2, :3], [[np.pi / 2, 1.5, 0.12], [np.radians(80), np.radians(70), 0.2]])
    assert table.values[0, 3] == 0.9
    assert np.isnan(table.values[1:, 3]).all()
    np.testing.assert_allclose(table.sigmas[:, 2], [5e-5, 5e-5, 1e-4])
    assert not table.sigmas[:, :2].any()
    distance = table.quantities[3]
    assert (distance.kind, distance.of, distance.point) == ("distance", "tool", (0.0, 0.0, 0.05))
    assert distance.reference == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_written_files_are_read_again(mark):
    columns = ["joint1", "joint3", "tool.x", "tool.rz", "tool.along(0 3 4)"]
    values = [[1.0, 2.0, 0.1, 0.2, 0.3], [1.1, 2.1, np.nan, 0.3, 0.4]]
    written = Measurements.of(ROBOT, columns, values, [0.0, 1e-4, 1e-5, 1e-4, 1e-5])
    again = read(written.text().replace(",", mark))
    np.testing.assert_allclose(again.values, values, rtol=1e-9)
    np.testing.assert_allclose(again.sigmas, written.sigmas, rtol=1e-9)
    assert again.quantities == written.quantities
    np.testing.assert_allclose(again.quantities[4].reference, [0.0, 0.6, 0.8])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "m.csv: the file is empty"),
        ("joint1,joint3\n1,2\n", "m.csv, line 1: the first column is 'pose', the names of the poses, not 'joint1'"),
        ("pose,jonit1\n", "m.csv, line 1, column 2: 'jonit1' is neither a joint (joint1, joint2, joint3 ...)"),
        ("pose,tol.x\n", "has no node 'tol': did you mean 'tool'?"),
        ("pose,tool.q\n", "'tool.q': unknown quantity 'q' (known: x, y, z, rx, ry, rz, distance, along)"),
        ("pose,tool.distance\n", "distance takes a fixed point or a direction in parentheses"),
        ("pose,tool.distance(1 2mm 3)\n", "can be read two ways"),
        ("pose,tool.distance(5000 0 0)\n", "is in m, which can't be meant: write the unit, such as 5000mm"),
        ("pose,tool.x [deg]\n", "line 1, column 2: tool.x: [deg] is an angle: a length is wanted"),
        ("pose,tool.x (mm)\n", "line 1, column 2: 'tool.x (mm)': write the unit in square brackets: tool.x [mm]"),
        ("pose,tool.distance(1 0 0) (mm)\n", "in square brackets: tool.distance(1 0 0) [mm]"),
        ("pose,tool.x (ball)\n", "'tool.x (ball)' is neither a joint"),
        ("pose,joint1,tool.x [mm]\na,1\n", "line 2: 2 cells, but the header has 3 columns"),
        ("pose,joint1,tool.x [mm]\n\na,1,2\n", "line 3, column tool.x: no sigma is given"),
        ("pose,joint1,tool.x [mm]\nsigma,,0\n", "line 2, column tool.x: a standard deviation is above 0"),
        ("pose,joint1,tool.x [mm]\nsigma,,1\na,x,2\n", "line 3, column joint1: 'x' is not an angle"),
        ("pose;joint1;tool.x [mm]\nsigma;;0,05\n", "line 2, column tool.x: '0,05' has a decimal comma: write 0.05"),
        ("pose,joint1,tool.x [mm]\na,1,5,312,25\n", "5 cells, but the header has 3 columns: write decimal points"),
        ("pose,joint1,tool.x\nsigma,,0.05mm\na,1,312\n", "312 mm? (the header gives no unit: write tool.x [mm])"),
    ],
)  # fmt: skip
def test_mistakes_are_named(text, message):
    with pytest.raises(DesignError, match=re.escape(message)):
        read(text)


# --- measurement mistakes ---------------------------------------------------------------------------------------------
# Measurements with one mistake: they are refused, and the mistake is named with its correction.


Mistaken = Callable[[Measurements], Measurements]

GON = 0.9  # degrees
FEW = Parameters("five_bar", ["*.d", "link1.theta", "link3.theta"])  # it stays planar
ALL = cache(everything)


@cache
def right(name: str, kinds: int, errors: float = 1.0, seed: int = 1, poses: int = 8) -> Measurements:
    """Readings of a robot that differs from its description by expected errors, in its first kinds of coordinates."""
    parameters = ALL(name)
    free = ~np.isin(parameters.names, Design(parameters).evaluate().opening)
    errors_now = errors * errors_of(parameters) * free
    truth = parameters.values + errors_now * np.random.default_rng(seed).normal(size=len(parameters))
    columns = [f"{parameters.mechanism.end}.{c}" for c in POSE[:kinds]]
    return noisy(exact(parameters, columns, truth, poses, seed), seed)


@pytest.fixture(scope="module")
def few() -> Measurements:
    """Readings of a five-bar of which a few parameters differ from their description by expected errors."""
    errors = np.array([3e-4 if name.endswith(".d") else np.radians(0.05) for name in FEW.names])
    truth = FEW.values + errors * np.random.default_rng(3).normal(size=len(FEW))
    return noisy(exact(FEW, ["tool.x", "tool.y"], truth, poses=15), 4)


def checked(name: str, measurements: Measurements, sigma: dict[str, str] | None = None) -> None:
    """Compare measurements with a robot as it is described."""
    check(ColumnComparison(Observation(ALL(name), measurements), expected_errors(ALL(name), sigma)))


def of_values(change: Callable[..., None]) -> Callable[..., Mistaken]:
    """Make a mistake of a function that changes values in place, and of its other arguments."""

    def mistake(*arguments, **options) -> Mistaken:
        def mistaken(measurements: Measurements) -> Measurements:
            values = measurements.values.copy()
            change(values, *arguments, **options)
            return replace(measurements, values=values)

        return mistaken

    return mistake


@of_values
def scaled(values, factor, *at, offset=0.0):
    values[:, at] = factor * values[:, at] + offset


@of_values
def placed(values, at, source):
    values[:, at] = values[:, source]


@of_values
def inverted(values):
    for row in values:
        pose = pin.SE3(pin.rpy.rpyToMatrix(*row[-3:]), row[-6:-3].copy()).inverse()
        row[-6:] = *pose.translation, *pin.rpy.matrixToRpy(pose.rotation)


@of_values
def in_frame(values, angles, place):
    """Positions in a frame that stands elsewhere."""
    values[:, -3:] = values[:, -3:] @ pin.rpy.rpyToMatrix(*np.radians(angles)).T + place


@of_values
def about_own_axes(values):
    values[:, -3:] = Rotation.from_euler("xyz", values[:, -3:]).as_euler("XYZ")


@of_values
def shifted(values):
    values[:, -3:] = np.roll(values[:, -3:], 1, axis=0)


@of_values
def reversed_lines(values):
    values[:, -3:] = values[::-1, -3:].copy()


def named(names: dict[str, str]) -> Mistaken:
    """The same numbers below other names."""

    def change(measurements: Measurements) -> Measurements:
        columns = [names.get(quantity.name, quantity.name) for quantity in measurements.quantities]
        return Measurements.of(ALL("five_bar").mechanism, columns, measurements.values, measurements.sigmas)

    return change


def tracked(mistaken: Mistaken) -> Mistaken:
    """The same mistake in positions that a tracker has read."""

    def change(plain: Measurements) -> Measurements:
        columns = [quantity.name + (" @ tracker" if quantity.kind != "joint" else "") for quantity in plain.quantities]
        in_tracker = in_frame((2, -1, 120), (1.9, -0.6, 0.4))(plain)
        return mistaken(Measurements.of(ALL("scara").mechanism, columns, in_tracker.values, in_tracker.sigmas))

    return change


MISTAKES = [
    # signs
    ("five_bar", 2, scaled(-1.0, 2), "with the opposite sign of tool.x"),
    ("delta4", 3, scaled(-1.0, 0, 1, 2), "with the opposite sign of joint1, joint6, joint12 "),
    ("delta4", 3, in_frame((180, 0, 0), (0, 0, 0)), "with the opposite sign of platform.y, platform.z"),
    ("gough", 6, scaled(-1.0, 0), r"loops don't close .*They fit with the opposite sign of joint3 "),
    ("scara", 3, tracked(scaled(-1.0, 0)), "with the opposite sign of joint1 "),
    # units
    ("five_bar", 2, scaled(1 / GON, 0, 1), "with joint1, joint3 in gon instead of deg"),
    ("scara", 3, scaled(np.pi / 180, 0, 1, 2, 3), "joint4 in rad instead of deg .* multiply the numbers .* by 57.2958"),
    ("five_bar", 2, scaled(1e3, 2, 3), "with tool.x, tool.y in mm instead of m"),
    ("five_bar", 2, scaled(1 / 25.4, 2, 3), "tool.y in in instead of mm"),
    ("scara", 3, scaled(0.1, 4, 5, 6), "tool.z in cm instead of mm"),
    # columns and lines
    ("five_bar", 2, placed((2, 3), (3, 2)), "with columns tool.x and tool.y exchanged"),
    ("delta4", 3, placed((0, 1, 2), (1, 2, 0)), "in the order joint12, joint1, joint6"),
    ("scara", 3, shifted(), "tool.z of the line below"),
    ("scara", 3, reversed_lines(), r"order of lines \(8 at 1, 7 at 2, 6 at 3, 5 at 4 and "),
    # names
    ("five_bar", 2, named({"tool.x": "link2.x", "tool.y": "link2.y"}), "with tool in place of link2"),
    ("five_bar", 2, named({"joint3": "joint4"}), "with joint3 in place of joint4"),
    ("five_bar", 2, named({"joint3": "joint2"}), r"loops don't close .*They fit with joint3 in place of joint2"),
    # zeros
    ("scara", 3, scaled(1.0, 1, offset=np.pi / 2), r"with -(89|90)\S* deg added to joint2"),
    ("five_bar", 2, scaled(-1.0, 1, offset=np.pi), r"with -(179|180)(\.\d*)? deg minus the readings of joint3"),
    ("gough", 6, scaled(1.0, 1, offset=0.05), r"loops don't close .*They fit with -0\.0[45]\d* m added to joint9"),
    ("delta4", 3, scaled(1.0, 5, offset=0.5), r"with -0\.\d+ m added to platform\.z"),
    # frames, and ways to write a rotation
    ("scara", 3, in_frame((0, 0, 90), (0.2, 0.1, 0)), r"of its own \(tracker at .*, turned by (89|90)\S* deg about"),
    ("arm7", 6, inverted(), "with poses of the world in tool, the inverse"),
    ("arm7", 6, about_own_axes(), "tool.rz as Euler angles XYZ"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "kinds", "mistaken", "says"), MISTAKES)
def test_a_mistake_is_named_before_the_estimate(name, kinds, mistaken, says):
    with pytest.raises(DesignError, match=says) as caught:
        checked(name, mistaken(right(name, kinds)))
    assert "is that what was measured? Then " in str(caught.value)


@pytest.mark.parametrize(("name", "kinds"), [("arm7", 6), ("five_bar", 2), ("delta4", 6), ("gough", 6)])
def test_true_deviations_of_three_expected_errors_are_no_mistake(name, kinds):
    checked(name, right(name, kinds, 3.0, 0, 8))


def test_the_right_readings_are_taken_without_a_word(few):
    calibration = calibrate(FEW, few)
    assert not calibration.outliers
    assert calibration.fit < 2.0


@pytest.mark.parametrize(
    ("factor", "says"), [(1e3, "these are too large, or in another unit"), (1e-3, "these are too small")]
)
def test_sigmas_in_another_unit_are_named(few, factor, says):
    """Also by few readings."""
    with pytest.warns(cinegen.CinegenWarning, match=says):
        calibrate(FEW, replace(few, sigmas=factor * few.sigmas), folds=0)


def test_a_sign_that_the_expected_errors_could_explain_is_named_by_the_estimate():
    """The platform of a delta rotates by its errors alone: about z by 0.1 degrees."""
    flipped = scaled(-1.0, 8)(right("delta4", 6, poses=20))
    checked("delta4", flipped)
    with pytest.raises(DesignError, match=r"They fit with the opposite sign of platform\.rz \(.* then\)"):
        calibrate(ALL("delta4"), flipped, folds=0)


@pytest.mark.parametrize(("name", "changed"), [("scara", {"link1.theta": "20deg"}), ("five_bar", {"base.d": "60mm"})])
def test_a_robot_that_really_is_so_is_taken_with_the_expected_errors_that_the_message_names(name, changed):
    """The zero of a joint, and a base that stands elsewhere."""
    parameters = Parameters("scara", ["*.d", "link1.theta", "link2.theta"]) if name == "scara" else FEW
    truth = parameters.with_changed(changed)
    measured = noisy(exact(parameters, ["tool.x", "tool.y"], truth, 20), 1)
    with pytest.raises(DesignError) as caught:
        calibrate(parameters, measured, folds=0)
    remedy = re.search(r"--sigma '(.*)'$", str(caught.value))[1]
    estimate = calibrate(parameters, measured, folds=0, sigma=[tuple(part.split("=")) for part in remedy.split(", ")])
    assert estimate.fit < 2.0


def test_a_robot_that_no_parameter_explains_is_refused(few):
    """Before, an estimate with a chi-square of 1e6 was taken with a warning."""
    values = few.values.copy()
    values[:, 1] = np.random.default_rng(1).permutation(values[:, 1])
    says = r"the estimate changes \S+ by .*, and the readings are still off by \S+ sigma"
    with pytest.raises(DesignError, match=says):
        calibrate(FEW, replace(few, values=values), folds=0, sigma={"*": "10mm"})


def test_what_no_mistake_explains_is_refused_with_its_column(few):
    values = few.values.copy()
    values[:, 2] += np.random.default_rng(10).uniform(-0.1, 0.1, len(few))
    with pytest.raises(DesignError, match=r"column tool\.x: \d+ of 15 readings contradict .*no other sign, unit or"):
        calibrate(FEW, replace(few, values=values))


def test_a_minority_of_outliers_is_left_out_and_counts_in_held_out_errors(few):
    values = few.values.copy()
    values[3, 2] += 0.02
    calibration = calibrate(FEW, replace(few, values=values))
    assert [(outlier.pose, outlier.column) for outlier in calibration.outliers] == [(3, 2)]
    (held,) = calibration.held_out
    assert held.count == 30
    assert held.after == pytest.approx(0.02 / np.sqrt(30), rel=0.1)
    assert held.kept < 1e-4


def test_a_parameter_that_is_far_from_its_description_is_named_and_taken_when_it_is_expected():
    parameters = ALL("five_bar")
    truth = parameters.values.copy()
    truth[parameters.names.index("link2.d")] += 0.02
    measured = noisy(exact(parameters, ["tool.x", "tool.y"], truth, poses=25), 6)
    with pytest.warns(cinegen.CinegenWarning, match=r"link2\.d by 0\.02 m, 67 times.*--sigma link2\.d=(\S+)") as met:
        estimate = calibrate("five_bar", measured, folds=0)
    wanted = truth[parameters.names.index("link2.d")]
    assert estimate.values[estimate.names.index("link2.d")] == pytest.approx(wanted, abs=1e-3)
    name, _, amount = str(met[0].message).rpartition("--sigma ")[2].partition("=")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        calibrate("five_bar", measured, sigma={name: amount}, folds=0)


# --- left out parameters ----------------------------------------------------------------------------------------------
# Parameters that were not estimated, and explain the readings better, or as well: towers of a delta.


DELTA = everything("delta4")


def readings(changed: dict[str, str], kinds: int, noise: float, angles: float = 1.0) -> Measurements:
    """Readings of a delta with other dimensions: positions of its platform, or poses; factors of their noise."""
    measured = exact(DELTA, [f"platform.{c}" for c in POSE[:kinds]], DELTA.with_changed(changed), 25, 1)
    factors = np.array([noise if quantity.kind in "xyz" else angles for quantity in measured.quantities])
    return noisy(replace(measured, sigmas=factors * measured.sigmas), 101)


def test_a_tower_beside_its_place_is_told_from_a_turned_one():
    """A turned tower turns the joints of its rods, too: the readings don't fit then."""
    measured = readings({"link6.r": "8mm"}, 3, 1.0)
    with pytest.warns(CinegenWarning, match=r"link6\.r \(or .*\), which is not estimated, would explain") as met:
        turned = calibrate(Parameters("delta4", ["link6.gamma"]), measured, folds=0)
    added = re.search(r"(link\S+) \(or .* add it to --vary", str(met[0].message))[1]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        estimate = calibrate(Parameters("delta4", ["link6.gamma", added]), measured, folds=0, sigma={added: "10mm"})
    values = dict(zip(estimate.names, estimate.values, strict=True))
    assert values["link6.r"] == pytest.approx(0.008, abs=2e-4)
    assert values["link6.gamma"] == pytest.approx(np.radians(120), abs=1e-4)
    assert turned.values[0] < np.radians(119.9)  # -0.13 degrees: what a wrong model makes of the place


def test_several_towers_beside_their_places_are_named():
    measured = readings({"link6.r": "8mm", "link12.r": "5mm"}, 3, 1.0)
    says = r"link6\.r .*, link12\.r .*, which are not estimated, .* add them to --vary"
    with pytest.warns(CinegenWarning, match=says):
        calibrate(Parameters("delta4", ["*.gamma"]), measured, folds=0)


def test_an_angle_that_fits_is_told_from_a_place_that_fits_as_well_by_the_rotation_of_the_platform():
    """Positions of 5 mm noise fit a turned tower, and one beside its place."""
    turned = Parameters("delta4", ["link6.gamma"])
    says = r"link6\.gamma changes by 0\.\d+ deg, but link6\.r by \d.* instead fits as well .* measure what differs"
    with pytest.warns(CinegenWarning, match=says):
        calibrate(turned, readings({"link6.gamma": "120.3deg"}, 3, 100.0), folds=0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        estimate = calibrate(turned, readings({"link6.gamma": "120.3deg"}, 6, 100.0), folds=0)
    assert estimate.values[0] == pytest.approx(np.radians(120.3), abs=4.0 * estimate.sigmas[0])


# --- measuring frames -------------------------------------------------------------------------------------------------
# Devices that stand anywhere, and targets that are fixed anywhere on a node: where they are is estimated, too.


TRACKER = pin.SE3(pin.rpy.rpyToMatrix(0.4, -0.7, 2.5), np.array([2.5, -1.8, 0.9]))
BALL = pin.SE3(pin.rpy.rpyToMatrix(0.5, 0.3, -1.0), np.array([0.06, -0.03, 0.08]))


def read_by_tracker(
    parameters: Parameters, columns: list[str], truth: np.ndarray, poses: int = 40, seed: int = 1
) -> Measurements:
    return exact(parameters, columns, truth, poses, seed, {"tracker": TRACKER, "ball": BALL})


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
    prediction = observation.predict(observation.values)
    for q, row in zip(prediction.q, prediction.values, strict=True):
        seen = TRACKER.actInv(mechanism.placement(q, "tool") * BALL)
        np.testing.assert_allclose(row[:3], seen.translation, atol=1e-12)
        np.testing.assert_allclose(row[3:6], pin.rpy.matrixToRpy(seen.rotation), atol=1e-12)
        tip = TRACKER.actInv(mechanism.placement(q, "tool")).act(np.array([0.0, 0.0, 0.05]))
        np.testing.assert_allclose(row[6], np.linalg.norm(tip - [1.0, 0.0, 0.0]), atol=1e-12)
        point = TRACKER.actInv(mechanism.placement(q, "link4")).act(np.array([0.01, 0.0, 0.0]))
        np.testing.assert_allclose(row[7], point @ [1.0, 1.0, 2.0] / np.sqrt(6.0), atol=1e-12)
        np.testing.assert_allclose(row[8], mechanism.placement(q, "link5").translation[0], atol=1e-12)
    theta = observation.values + np.append([1e-3], 0.2 * np.random.default_rng(0).normal(size=12))
    prediction = observation.predict(theta)
    for k, name in enumerate(observation.names):
        ends = [observation.predict(theta + step * np.eye(13)[k], derivatives=False).values for step in (1e-6, -1e-6)]
        np.testing.assert_allclose(prediction.jacobian[:, :, k], (ends[0] - ends[1]) / 2e-6, atol=2e-9, err_msg=name)


def test_a_tracker_and_its_target_are_found():
    """Lengths of an arm from the positions of a ball, two of whose readings are wrong by a metre."""
    parameters = Parameters("arm7", ["link3.r", "link4.d", "link5.r"])
    truth = parameters.with_changed({"link3.r": parameters.values[0] + 4e-4, "link5.r": parameters.values[2] - 6e-4})
    readings = noisy(read_by_tracker(parameters, [f"tool(ball).{c} @ tracker" for c in "xyz"], truth), 2)
    readings.values[3, 7] += 1.0
    readings.values[17, 9] -= 1.0
    estimate = calibrate(parameters, readings, folds=0)
    assert estimate.subspace.rank == len(estimate.names) == 3 + 6 + 3
    assert (np.abs(estimate.values[:3] - truth) < 4.0 * estimate.sigmas[:3]).all()
    assert {(outlier.pose, outlier.column) for outlier in estimate.outliers} == {(3, 7), (17, 9)}
    device, ball = pin.SE3(estimate.frames["tracker"]), estimate.frames["ball"]
    sigma = estimate.sigmas[3:]
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
    result = calibrate(parameters, readings)
    assert not result.outliers
    assert result.subspace.rank == rank
    assert 0.8 < result.fit < 1.25
    for held in result.held_out:
        assert held.noise < held.after < 2.0 * held.noise
    named = [
        group for group in result.dependencies if group.text.startswith("robot and tracker move together as one body: ")
    ]
    assert len(named) >= 4
    tracker = [f"tracker.{c}" for c in POSE]
    changes = [dict(zip(group.names, change, strict=True)) for group in result.dependencies for change in group.changes]
    moved = [[change.get(component, 0.0) for component in tracker] for change in changes]
    assert np.linalg.matrix_rank(moved, tol=1e-6) == 6
    counted = rank + len(result.without_effect) + sum(len(group.changes) for group in result.dependencies)
    assert counted == len(result.names)
    assert changed_by_dependencies(result) < 1e-5


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
        message = f"m.csv: .* {factor} times as large: are they in {meant}, and read as {unit}"
        with pytest.raises(DesignError, match=message):
            calibrate(parameters, bad)
