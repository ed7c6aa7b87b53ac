"""Accuracy of mechanisms, against closed forms and Monte Carlo with loops closed."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from small_robots import four_bar, two_bars

import raff2urdf
from cinegen.design import DesignError, Parameters, Tolerances, tolerance
from cinegen.errors import ClosureError

FOUR_BAR = four_bar(words=("actuated 1", "", ""), more='frame 6 { name "tool" parameters { gamma 20 d 150 } pred 2 }')
UNIVERSAL = raff2urdf.loads(
    "RAFF arm robot arm { link 1 { joint universal pred 0 } frame 2 { parameters { d 300 } pred 1 } }"
)


@pytest.fixture
def two_r(tmp_path):
    (tmp_path / "arm.raff").write_text(two_bars())
    return tmp_path / "arm.raff"


@pytest.fixture
def bars(tmp_path):
    (tmp_path / "bars.raff").write_text(FOUR_BAR)
    return tmp_path / "bars.raff"


def test_a_2r_arm(two_r):
    sigma, encoder = {"link2.d": 1e-4, "tool.d": 2e-4}, {"joint1": 1e-3, "joint2": "0.1deg"}
    report = tolerance(two_r, sigma, encoder=encoder, samples=30_000)
    first, second, a, b = math.radians(30), math.radians(80), 0.4, 0.3
    u, v = (np.array([math.cos(x), math.sin(x)]) for x in (first, second))
    un, vn = (np.array([-x[1], x[0]]) for x in (u, v))
    # position by a, b, q1, q2, and its second derivatives
    jacobian = np.column_stack([u, v, a * un + b * vn, b * vn])
    deviation = np.array([1e-4, 2e-4, 1e-3, math.radians(0.1)])
    np.testing.assert_allclose(report.covariance[:2, :2], (jacobian * deviation**2) @ jacobian.T, rtol=1e-10)
    np.testing.assert_allclose(report.sigma[5], math.hypot(*deviation[2:]), rtol=1e-10)
    np.testing.assert_allclose(report.covariance[2:5], 0.0, atol=1e-20)
    width = 3.0 * deviation
    np.testing.assert_allclose(report.linear[:2], np.abs(jacobian) @ width, rtol=1e-10)
    zero = np.zeros(2)
    hessian = np.array([[zero, zero, un, zero], [zero, zero, vn, vn],
                        [un, vn, -a * u - b * v, -b * v], [zero, vn, -b * v, -b * v]])  # fmt: skip
    bend = 0.5 * np.einsum("ijx,i,j->x", np.abs(hessian), width, width)
    np.testing.assert_allclose(report.second_order[:2], bend, rtol=1e-4)
    np.testing.assert_allclose(report.second_order[5], 0.0, atol=1e-12)
    assert report.covariance_error < 0.03
    assert report.monte_carlo.outside == report.monte_carlo.failed == 0
    assert report.monte_carlo.largest[0] > 0.5 * report.linear[0]


def test_one_sample_compares_nothing(two_r):
    assert tolerance(two_r, {"link2.d": 1e-4}, samples=1).agreement == "1 sample with loops closed: too few to compare"


def coupler_point(a, b, c, g, e, slant, angle):
    """Return the coupler point of a four-bar, in closed form. For complex lengths, too."""
    ax, ay = a * np.cos(angle), a * np.sin(angle)
    bx, by = towards_the_pin(g - ax, -ay, b, c)  # direction of the coupler
    c, s = e * np.cos(slant), e * np.sin(slant)
    return np.array([ax + c * bx - s * by, ay + s * bx + c * by])


def towards_the_pin(dx, dy, b, c):
    """Return the direction of a bar of length b, whose end a pin joins to that of a bar of length c, which begins
    (dx, dy) from it: two circles intersect there."""
    square = dx * dx + dy * dy
    along = (square + b * b - c * c) / (2.0 * square)
    across = np.sqrt(b * b / square - along * along)
    return (along * dx - across * dy) / b, (along * dy + across * dx) / b


def test_a_four_bar(bars):
    names = ["link2.d", "frame4.d", "frame5.d", "link3.d", "tool.d", "tool.gamma", "link1.theta"]
    deviation = np.array([5e-5, 1e-4, 2e-5, 8e-5, 1e-4, 5e-4, 3e-4])
    sigma = dict(zip(names, deviation, strict=True))
    report = tolerance(bars, {k: v for k, v in sigma.items() if k != "link1.theta"},
                       encoder={"joint1": sigma["link1.theta"]}, samples=30_000)  # fmt: skip
    numbers = np.array([0.12, 0.36, 0.24, 0.4, 0.15, math.radians(20), report.q[0]])
    assert report.q.shape == (3,)  # joint1 first
    np.testing.assert_allclose(report.pose[:2, 3], coupler_point(*numbers), atol=1e-12)
    step = 1e-30j * np.eye(7)
    jacobian = np.column_stack([coupler_point(*(numbers + h)).imag / 1e-30 for h in step])
    np.testing.assert_allclose(report.covariance[:2, :2], (jacobian * deviation**2) @ jacobian.T, rtol=1e-8)
    np.testing.assert_allclose(report.linear[:2], np.abs(jacobian) @ (3.0 * deviation), rtol=1e-8)
    assert report.covariance_error < 0.03
    assert report.monte_carlo.outside == report.monte_carlo.failed == 0
    share = {source.name: part for source, part in report.contributors()}
    total = ((jacobian * deviation) ** 2).sum()
    np.testing.assert_allclose(share["frame6.gamma"], ((jacobian[:, 5] * deviation[5]) ** 2).sum() / total, rtol=1e-8)


DRIVE = "link 1 { parameters { theta %s } type 2 pred 0 actuated 1 }"
SLIDE = 'link 2 { parameters { alpha 30 r %s } type 1 pred 0 } frame 3 { name "tool" parameters { d 40 } pred 2 }'
SCREW = f"{DRIVE % 20} {SLIDE % 12.277778} coupling {{ link 2 link 1 lead 5 offset 12 }}"
CAM = f"{DRIVE % 20} {SLIDE % 7.2} coupling {{ link 2 link 1 polynomial ( 0.2 0.01 -0.0001 ) }}"
GEARED_FIVE_BAR = f"""{DRIVE % 60} link 2 {{ parameters {{ d 100 theta -21.3 }} type 2 pred 1 }}
  link 4 {{ parameters {{ d 150 theta 120 }} type 2 pred 0 }} link 5 {{ parameters {{ d 80 theta -68 }} type 2 pred 4 }}
  frame 3 {{ name "tool" parameters {{ d 250 }} pred 2 }} frame 6 {{ parameters {{ d 220 }} pred 5 }}
  constraint {{ frame 3 frame 6 type 2 }} coupling {{ link 4 link 1 ratio -2 offset 240 }}"""


def on_the_slide(lift):
    return np.array([0.04 + 0.0 * lift, -0.5 * lift, math.sqrt(0.75) * lift])


def screw_driven(angle):
    return on_the_slide(0.012 + 0.005 * angle / math.tau)


def cam_driven(angle):
    x = np.degrees(1.0) * angle
    return on_the_slide(1e-3 * (0.2 * x + 0.01 * x**2 - 1e-4 * x**3))


def gear_driven(angle, outer=0.25):
    other = 4.0 / 3.0 * math.pi - 2.0 * angle
    ax, ay = 0.1 * np.cos(angle), 0.1 * np.sin(angle)
    bx, by = towards_the_pin(0.15 + 0.08 * np.cos(other) - ax, 0.08 * np.sin(other) - ay, outer, 0.22)
    return np.array([ax + outer * bx, ay + outer * by, 0.0 * angle])


@pytest.mark.parametrize(("robot", "moved"), [(SCREW, screw_driven), (CAM, cam_driven), (GEARED_FIVE_BAR, gear_driven)])
def test_couplings_pass_on_errors_of_encoders(tmp_path, robot, moved):
    """By couplings alone, and together with a loop; to second order, and in samples."""
    (tmp_path / "coupled.raff").write_text(f"RAFF coupled\nrobot coupled {{ {robot} }}")
    report = tolerance(tmp_path / "coupled.raff", encoder={"joint1": "0.1deg"}, node="tool", samples=2000)
    sigma, angle, step = math.radians(0.1), report.q[0], 1e-3
    slope = moved(angle + 1e-30j).imag / 1e-30
    bend = (moved(angle + step) - 2.0 * moved(angle) + moved(angle - step)) / step**2
    np.testing.assert_allclose(report.pose[:3, 3], moved(angle), atol=1e-12)
    np.testing.assert_allclose(report.covariance[:3, :3], sigma**2 * np.outer(slope, slope), rtol=1e-9, atol=1e-20)
    np.testing.assert_allclose(report.second_order[:3], 4.5 * sigma**2 * np.abs(bend), rtol=1e-3, atol=1e-12)
    np.testing.assert_allclose(report.monte_carlo.largest[:3], 3.0 * sigma * np.abs(slope), rtol=0.05, atol=1e-15)
    assert report.covariance_error < 0.1
    assert report.monte_carlo.failed == report.monte_carlo.outside == 0
    reading = tolerance(tmp_path / "coupled.raff", encoder={"joint2": 1e-3}, node="tool")
    assert reading.idle == ("joint2 (encoder)",)  # a follower's encoder moves nothing


def test_dimensions_of_a_geared_five_bar(tmp_path):
    (tmp_path / "geared.raff").write_text(f"RAFF geared\nrobot geared {{ {GEARED_FIVE_BAR} }}")
    report = tolerance(tmp_path / "geared.raff", {"tool.d": 1e-4}, node="tool")
    slope = gear_driven(report.q[0], 0.25 + 1e-30j).imag / 1e-30
    np.testing.assert_allclose(report.covariance[:3, :3], 1e-8 * np.outer(slope, slope), rtol=1e-9, atol=1e-20)


def test_encoders_of_joints_that_are_coupled_contradict_each_other(tmp_path):
    """And what remains open of a gear is an angle, of a screw a length."""
    both = SCREW.replace("pred 0 }", "pred 0 actuated 1 }")
    gear = f"{DRIVE % 10} {DRIVE.replace('link 1', 'link 2') % -20} coupling {{ link 2 link 1 ratio -2 }}"
    for robot, position, angle in ((both, 0.005 / math.tau, 0.0), (gear, 0.0, 2.0)):
        (tmp_path / "both.raff").write_text(f"RAFF both\nrobot both {{ {robot} }}")
        forced = tolerance(tmp_path / "both.raff", encoder={"joint1": 1e-3}).contradicting
        assert forced.names == ("joint1 (encoder)",)
        np.testing.assert_allclose([forced.position[0], forced.angle[0]], [3e-3 * position, 3e-3 * angle], rtol=1e-9)


def test_errors_that_only_contradict_redundant_encoders_are_listed_apart(tmp_path):
    """The same linkage with one encoder is assembled with the error of a length."""
    for words, names in ((("actuated 1", "", ""), ()), (("actuated 1", "", "actuated 1"), ("frame5.d",))):
        (tmp_path / "bars.raff").write_text(four_bar(words=words), encoding="utf-8")
        report = tolerance(tmp_path / "bars.raff", {"frame5.d": 1e-4, "link3.r": 1e-4})
        assert report.contradicting.names == names
        assert report.forced.names == ("link3.r",)


def test_the_forced_gap_of_a_coupling_is_that_of_the_joint_that_follows(tmp_path):
    """4 b + 2 a = 0: if a is off by 1, b is off by 1/2 from where a drives it."""
    bodies = "".join(f'<body name="{x}"><joint name="{x}" axis="0 0 1"/><geom size="0.1"/></body>' for x in "ab")
    path = tmp_path / "pair.xml"
    path.write_text(f"""<mujoco model="pair"><worldbody>{bodies}</worldbody>
      <tendon><fixed name="sum"><joint joint="b" coef="4"/><joint joint="a" coef="2"/></fixed></tendon>
      <equality><tendon tendon1="sum"/></equality>
      <actuator><general joint="a"/><general joint="b"/></actuator></mujoco>""")
    forced = tolerance(path, encoder={"joint1": 1e-3}).contradicting
    np.testing.assert_allclose([*forced.position, *forced.angle], [0.0, 3e-3 * 0.5], rtol=1e-9)


def test_covariance_and_worst_case_hold_for_samples_of_a_spatial_loop():
    report = tolerance("delta4", {"link*.d": "0.05mm", "link*.alpha": "0.01deg"}, samples=30_000, seed=1)
    assert report.monte_carlo.failed == report.monte_carlo.outside == 0
    assert report.covariance_error < 0.03
    assert np.abs(report.monte_carlo.mean).max() < 0.1 * report.sigma.max()


def test_what_the_linear_bound_misses_is_of_second_order(two_r):
    """The end of an arm that is stretched along x moves against x whichever way its joint errs."""
    two_r.write_text(two_bars((0, 0)))
    report = tolerance(two_r, encoder={"joint1": "1deg"}, samples=20_000)
    assert report.linear[0] < 1e-15
    np.testing.assert_allclose(report.second_order[0], 0.5 * 0.7 * math.radians(3) ** 2, rtol=1e-3)
    assert 0.5 * report.second_order[0] < report.monte_carlo.largest[0] <= report.worst[0]


def test_play_is_even_in_a_disc(two_r):
    report = tolerance(two_r, play={"joint2": "0.2mm"}, samples=50_000)
    np.testing.assert_allclose(report.covariance[:2, :2], np.eye(2) * (1e-4**2), atol=1e-20)
    np.testing.assert_allclose(report.linear[:2], 2e-4)
    np.testing.assert_allclose(report.monte_carlo.covariance[:2, :2], np.eye(2) * 1e-8, atol=2e-10)
    assert report.monte_carlo.largest[:2].max() <= 2e-4
    tilted = tolerance(two_r, play={"joint2": "0.1deg", "joint1.z": "0.5mm"})
    np.testing.assert_allclose(tilted.linear[2], 0.3 * math.radians(0.1) + 5e-4, rtol=1e-9)


def test_play_at_either_end_of_a_rocker_is_that_of_its_length(bars):
    """Only play along the rocker moves the coupler: the rocker yields across it."""
    rocker = tolerance(bars, {"frame5.d": 5e-5})
    for name in ("frame4-frame5", "joint3"):
        np.testing.assert_allclose(tolerance(bars, play={name: 1e-4}).covariance, rocker.covariance, atol=1e-15)


def test_over_constrained_mechanisms_are_forced():
    report = tolerance("five_bar", {"link2.alpha": "0.1deg", "link2.d": "0.1mm", "link3.r": "0.2mm"}, samples=1000)
    assert set(report.forced.names) == {"link2.alpha", "link3.r"}
    assert [source.name for source in report.sources] == ["link2.d"]
    gap = dict(zip(report.forced.names, report.forced.position, strict=True))["link3.r"]
    np.testing.assert_allclose(gap, 3.0 * 2e-4, rtol=1e-6)  # one arm is 0.6 mm higher than the other
    assert report.forced.worst_position >= gap
    assert report.monte_carlo.failed == 0


def test_dimensions_of_one_set_up_err_alike():
    """Both shoulders of a five-bar that are tilted alike close the loop, and tilt the plane of the arms."""
    ties = ["link1.alpha = link3.alpha", "link2.d = link4.d"]
    sigma = {"link1.alpha": "0.02deg", "link3.alpha": "0.02deg", "link*.d": "0.05mm"}
    apart, tied = tolerance("five_bar", sigma), tolerance("five_bar", sigma, ties=ties, samples=20_000)
    assert set(apart.forced.names) == {"link1.alpha", "link3.alpha"}
    assert not tied.forced.names
    x = tied.pose[:3, 3]
    np.testing.assert_allclose(tied.sigma[2], math.radians(0.02) * abs(x[1]), rtol=1e-9)  # about x
    names = [source.name for source in tied.sources]
    assert "link1.alpha = link3.alpha" in names
    assert "link2.d = link4.d" in names
    each = {source.name: tolerance("five_bar", {source.name: 5e-5}) for source in apart.sources}
    columns = [each[name].jacobian[:, 0] for name in ("link2.d", "link4.d")]
    others = sum(each[name].covariance for name in each if name not in ("link2.d", "link4.d"))
    wanted = others + np.outer(columns[0] + columns[1], columns[0] + columns[1]) * 5e-5**2
    np.testing.assert_allclose(tied.covariance[:2, :2], wanted[:2, :2], atol=1e-9 * wanted.max())
    assert tied.covariance_error < 0.05


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "no tolerances are given"),
        ({"sigma": {"link2.d": "0.1"}}, "'0.1' has no unit: write 0.1mm"),
        ({"sigma": {"link2.*": 0.1}}, "matches lengths and angles: write a unit"),
        ({"sigma": {"link2.d": -0.1}}, "is not negative"),
        ({"sigma": {"lnk2.d": 0.1, "link2.q": 0.1}}, "did you mean 'link2.d'"),
        ({"sigma": {"lnk2.d": 0.1, "link2.q": 0.1}}, "link2 has no parameter 'q'"),
        ({"play": [("joint2", 0.1), ("joint2.x", 0.2)]}, "the play of joint2 along x is given twice"),
        ({"encoder": {"joint1": "0.1mm"}}, "encoder of joint1: '0.1mm' is a length"),
        ({"sigma": {"link2.d": 0.1}, "interval": 1.73206}, "narrower than any normal distribution"),
        ({"source": UNIVERSAL, "encoder": {"joint1_Y": 0.1}}, "joint1_Y: the offset of its encoder is no parameter"),
        ({"source": "delta4", "play": {"link5-link11": 1e-4}}, "is rigid: it has no play"),
        ({"source": "five_bar", "sigma": {"link2.d": "1mm", "link4.d": "2mm"}, "ties": ["link2.d = link4.d"]},
         "link2.d and link4.d are tied, but have diff"),
        ({"source": "five_bar", "sigma": {"link5.d": "1mm"}, "ties": ["link5.d = 2*link2.d - 135mm"]},
         "link5.d follows from link2.d by a tie: give the toler"),
        ({"source": "five_bar", "sigma": {"link3.d": "1mm"}, "ties": ["link2.d = link4.d"]},
         "the tie 'link2.d = link4.d' has no effect: give one of its parameters a tolerance"),
        ({"sigma": {"link1.theta": "1deg"}, "encoder": {"joint1": "2deg"}},
         "the reading of joint1 is link1.theta: its error is given twice"),
        ({"source": "five_bar", "sigma": {"link5.d": "1mm"}, "ties": ["link5.d = 365mm"]},
         "every parameter that was named is tied to a constant"),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:.*the ties change values")
def test_errors_say_what_is_wrong(two_r, arguments, message):
    with pytest.raises(DesignError) as caught:
        tolerance(**{"source": two_r, "samples": 10} | arguments)
    assert message in str(caught.value)


def test_the_command(two_r, tmp_path, typed):
    picture = tmp_path / "errors.svg"
    options = ["--sigma", "*.d=0.1mm, *.alpha=0.1deg", "--encoder", "joint1=0.05deg", "--samples", "500"]
    tied = ["--tie", "link2.alpha = tool.alpha", "--interval", "2"]
    text = typed("tolerance", two_r, *options, *tied, "--plot", picture).out
    assert "arm: accuracy of tool at home: position " in text
    assert "Monte Carlo, 500 samples with loops closed" in text
    assert "link2.alpha = frame3.alpha" in text
    assert "Worst case within ±2 sigma: each error anywhere within 2 of its standard deviations" in text
    assert b"<svg" in picture.read_bytes()
    report = json.loads(typed("tolerance", two_r, *options, "--at", "joint1=0", "joint2=90", "--json").out)
    np.testing.assert_allclose(np.array(report["pose"])[:2, 3], [0.4, 0.3], atol=1e-12)
    said = typed("tolerance", "two_arms", "--sigma", "link*.d=1mm", code=1)
    assert "holds several robots: name one by --robot (" in said.err


def test_a_singular_configuration_has_no_bound():
    """The outer bars of a five-bar are in line: the actuated joints do not hold the tool across them."""
    tolerances = Tolerances("five_bar", {"link*.d": "0.1mm"})
    mechanism = tolerances.design.mechanism
    q = mechanism.q_home.copy()
    q[mechanism.q_index("joint5")] = 0.0
    q = mechanism.close(q, "joint5")
    assert np.isnan(tolerances.accuracy(q[None], "tool")[0])
    with pytest.raises(DesignError, match="is singular there"):
        tolerances.at(q)


def test_what_has_no_part_in_the_accuracy_is_told():
    assert tolerance("five_bar", {"frame20.gamma": "0.1deg", "frame20.d": "0.1mm"}).idle == ("frame20.gamma",)
    report = tolerance("delta4", {"link2.d": 1e-4, "link7.d": 1e-4})  # only rounding rotates its platform
    assert not report.contributors(orientation=True)
    assert len(report.contributors()) == 2


def test_equal_contributors_are_in_the_order_of_the_sources_whatever_the_rounding():
    rng = np.random.default_rng(0)
    report = tolerance("delta4", encoder={f"joint{j}": "0.01deg" for j in (1, 6, 12)})
    for _ in range(8):
        rounded = replace(report, shares=report.shares * (1.0 + 1e-12 * rng.normal(size=report.shares.shape)))
        assert [source.name for source, _ in rounded.contributors()] == [f"joint{j} (encoder)" for j in (1, 6, 12)]


def test_what_is_forced_is_what_loading_refuses():
    """And the gaps are those of the loops that are closed as well as they can be at the ends of the intervals."""
    parameters = Parameters("four_bar")
    tolerances = Tolerances(parameters, [("*.*", "0.05mm"), ("*.*", "0.02deg")])
    forced, length = tolerances.at().forced, parameters.mechanism.length
    for name in [name for name in parameters.names if not name.startswith("base")][::3]:
        p = parameters.values.copy()
        p[parameters.index(name)] += 1e-3 * (length if parameters.all[parameters.find(name)].unit == "m" else 1.0)
        if name in forced.names:
            with pytest.raises(ClosureError):
                parameters.mechanism_with(p)
        else:
            parameters.mechanism_with(p)
    width = {source.name: source.half_width for source in tolerances.sources}
    for name, position, angle in zip(forced.names, forced.position, forced.angle, strict=True):
        p = parameters.values.copy()
        p[parameters.index(name)] += width[name]
        gap = tolerances.design.evaluate(p, derivatives=False).gap[0]
        np.testing.assert_allclose(gap, max(position / length, angle), rtol=1e-5)
