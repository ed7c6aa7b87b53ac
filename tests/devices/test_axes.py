"""The axes of a sensor, inverted, swapped and scaled by one text: in RAFF, Python, `--sensor` and a session."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cinegen
from cinegen.devices import SensorError, TwistMapping, open_sensor
from cinegen.session import Session, SetupError, arrange
from cinegen.session import commands as c
from cinegen.session.decoding import check_names
from cinegen.session.message_types import CommandError
from cinegen.session.other_robots import OtherRobots
from raff2urdf import RaffError
from raff2urdf.axes import AXES, UNCHANGED, format_axes, parse_axes

RAFF = """robot r {{ link 1 {{ type 2 pred 0 parameters {{ d 100 }} }} frame 2 {{ pred 1 parameters {{ d 100 }} }}
  constraint {{ frame 2 sensor ( 0 1 ) }} }} sensor 1 {{ port "{port}" {axes} }}"""


def velocity(axes, twist, **options):
    return TwistMapping(axes=axes, speed=1.0, turning=1.0, **{"dead": 0.0, **options}).velocity(twist)


@given(
    st.permutations(range(6)),
    st.tuples(*[st.sampled_from([-1.0, 1.0]) for _ in AXES]),
    st.tuples(*[st.floats(0.01, 1.0) for _ in AXES]),
    st.tuples(*[st.floats(-1.0, 1.0) for _ in AXES]),
)
def test_a_mapping_and_its_inverse_are_the_identity(order, signs, sizes, twist):
    factors = np.array(signs) * np.array(sizes)
    inverse = np.argsort(order)
    forward = ", ".join(f"{factor!r}*{AXES[axis]}" for factor, axis in zip(factors.tolist(), order, strict=True))
    back = " ".join(f"{1.0 / float(factors[k])!r}*{AXES[k]}" for k in inverse)
    turned = velocity(forward, twist)
    assert turned == pytest.approx(factors * np.array(twist)[list(order)], rel=1e-12)
    assert velocity(back, tuple(turned)) == pytest.approx(twist, rel=1e-12)
    assert parse_axes(format_axes(parse_axes(forward))) == parse_axes(forward)


def test_what_is_left_out_stays_and_an_axis_may_command_a_translation_and_a_rotation():
    twist = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    assert velocity("x,-z  0 , 0.5*rx", twist) == pytest.approx([0.1, -0.3, 0, 0.2, 0, 0])
    assert velocity("0 0 z 0 0 +2e-1*z", twist) == pytest.approx([0, 0, 0.3, 0, 0, 0.06])
    assert velocity("rz, ry, rx, z, y, x", twist, translation=2, rotation=1) == pytest.approx([0.6, 0.5, 0, 0, 0, 0.1])
    assert format_axes(parse_axes("-x .5*z")) == "-x, 0.5*z, 0, 0, 0, 0"


def test_the_dominant_axis_is_that_of_the_device_with_effect():
    """Not what a factor makes of it, nor an axis that commands nothing; the dead zone is the device's, too."""
    twist = (0.9, 0.4, 0.3, 0.8, 0.0, 0.04)
    assert velocity("z, 0.1*y, 0, 0.5*y", twist, dominant=True) == pytest.approx([0, 0.04, 0, 0.2, 0, 0])
    assert velocity("2*rz, y", twist, dead=0.05)[0] == 0.0


@pytest.mark.parametrize(
    ("text", "column", "message", "remedied"),
    [
        ("x, q, z", 4, "'q' is no axis of a sensor: write x, y, z, rx, ry, rz, or 0 for none", "x, 0, z"),
        ("x 0.5 z", 3, "with a sign or a factor, such as -0.5*rx", "x -0.5*rx z"),
        ("x, nan*y", 4, "'nan*y' is no axis", "x, y"),
        ("x,,z", 3, "an axis is missing here: write 0 for none", "x,0,z"),
        ("", 1, "an axis is missing here: write 0 for none", "0"),
        ("x, y,", 6, "an axis is missing here: write 0 for none", "x, y,0"),
        ("x y z rx ry rz x", 16, "'x' is a seventh axis: remove it", "x y z rx ry rz"),
        ("x, 1e9*rx", 4, "the factor of '1e9*rx' is too large: write 100*rx at most", "x, 100*rx"),
        ("z, y, -z", 7, "'z' would command both x and z: write 0 for one of them, or another axis", "0, y, -z"),
        ("0 0 0 rx rx", 10, "'rx' would command both rx and ry: write 0 for one", "0 0 0 rx ry"),
    ],
)
def test_a_wrong_text_is_an_error_with_its_column_and_a_remedy(raff, text, column, message, remedied):
    with pytest.raises(cinegen.CinegenError, match=f"axes:1:{column}: .*{re.escape(message)}"):
        TwistMapping(axes=text)
    with pytest.raises(SensorError, match=f"'spnav:#axes=.*axes:1:{column}: "):
        arrange({"r": raff(RAFF.format(port="spnav:", axes=""))}, sensors=[f"1=spnav:#axes={text}"])
    with pytest.raises(ValueError, match=re.escape(message)):
        c.ChangeSensor("1", text)
    TwistMapping(axes=remedied)
    before = RAFF.format(port="spnav:", axes="axes ").splitlines()[-1].index("axes ") + 1
    with pytest.raises(RaffError) as caught:
        raff(RAFF.format(port="spnav:", axes=f'axes "{text}"'))
    (problem,) = caught.value.problems
    assert (problem.location.line, problem.location.column) == (3, before + 5 + column)
    assert message in problem.message
    assert raff(RAFF.format(port="spnav:", axes=f'axes "{remedied}"')).sensors[1]["axes"] == remedied


# --- the file, `--sensor` and the list -------------------------------------------------------------------------------


def test_the_command_line_replaces_the_axes_of_a_file_with_or_without_its_port(raff):
    mechanism = raff(RAFF.format(port="gamepad:", axes='axes "x, z, -y"'))

    def device(*sensors):
        setup = arrange({"r": mechanism}, sensors=sensors)
        sensor = setup.devices[0]
        return sensor.url, sensor.axes, setup.switches[0].first

    assert device() == ("gamepad:", "x, z, -y", None)
    assert device("1=spnav:") == ("spnav:", "x, z, -y", "1")
    assert device("1=#axes=-x,y") == ("gamepad:", "-x,y", "1")
    assert device("1=spnav:#axes=-x,y") == ("spnav:", "-x,y", "1")
    assert device("1=tcp://127.0.0.1:0?token=a#axes=-x") == ("tcp://127.0.0.1:0", "-x", "1")
    (_, added, _) = arrange({"r": mechanism}, sensors=["frame2=spnav:#axes=y,x"]).devices
    assert (added.url, added.axes) == ("spnav:", "y,x")
    assert raff(RAFF.format(port="gamepad:", axes="")).sensors[1]["axes"] == UNCHANGED
    with pytest.raises(SetupError, match="write NUMBER=URL"):
        arrange({"r": mechanism}, sensors=["frame2=#axes=y,x"])


def test_axes_that_would_have_no_effect_are_an_error(raff):
    for mechanism, sensors in (
        (raff(RAFF.format(port="path:circle", axes='axes "-x"')), []),
        (raff(RAFF.format(port="spnav:", axes='axes "-x"')), ["1=path:circle"]),
        (raff(RAFF.format(port="spnav:", axes="")), ["1=path:circle#axes=-x"]),
    ):
        with pytest.raises(SetupError, match="'path:circle', sends targets, which have no axes to change: remove axes"):
            arrange({"r": mechanism}, sensors=sensors)
    assert arrange({"r": raff(RAFF.format(port="path:circle", axes=""))}).devices
    with pytest.raises(SensorError, match=r"leave #axes=... out; TwistMapping\(axes=...\) and --sensor"):
        open_sensor("spnav:#axes=-x")


def test_the_list_of_sensors_shows_the_axes(raff, tmp_path, typed):
    raff(RAFF.format(port="gamepad:", axes='axes "x, z, -y"'))
    file = str(tmp_path / "mechanism.raff")
    assert "1: gamepad: (translation 3, rotation 3, axes x, z, -y) for frame2" in typed("sensors", file).out
    assert '"axes": "-x"' in typed("sensors", file, "--sensor", "1=#axes=-x", "--json").out


# --- a session -------------------------------------------------------------------------------------------------------


def test_a_session_keeps_changed_axes_until_the_file_changes_them(raff, closing):
    def setup(axes="", rate=1000.0):
        return replace(arrange({"r": raff(RAFF.format(port="gamepad:", axes=axes))}), rate=rate)

    session = closing(Session(setup('axes "-x"')))

    def shown():
        return next(sensor.axes for sensor in session.state().sensors if sensor.id == "1")

    session.obey(c.SelectSensor("r", "frame2", "1"))
    session.obey(c.ChangeSensor("1", "y x"))
    assert shown() == "y, x, 0, 0, 0, 0"
    session.obey(c.SelectSensor("r", "frame2", None))
    session.obey(c.SelectSensor("r", "frame2", "1"))
    assert shown() == "y, x, 0, 0, 0, 0"
    session.exchange(OtherRobots.of(setup('axes "-x"'), 1))
    assert shown() == "y, x, 0, 0, 0, 0"
    session.obey(c.GamepadInput((0, 1, 0, 0, 0, 0)))
    begin = session.state().robots["r"].tasks[0].target.translation
    for _ in range(10):
        session.tick()
    assert session.state().robots["r"].tasks[0].target.translation[0] > begin[0]
    session.exchange(OtherRobots.of(setup('axes "x z y"'), 2))
    assert shown() == "x, z, y, 0, 0, 0"
    with pytest.raises(CommandError, match=r"Unknown sensor '2' - at `\$.sensor`"):
        check_names(c.ChangeSensor("2", "x"), session.setup)
