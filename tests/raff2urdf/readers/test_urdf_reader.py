"""A URDF is read with what is wrong in it told by its line."""

import pytest

from raff2urdf.errors import RaffError
from raff2urdf.readers.urdf import default_value, joints, limits, velocity
from raff2urdf.readers.urdf_file import parse

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="upper"/>
  <link name="tool"/>
  <joint name="turn" type="revolute">
    <parent link="base"/>
    <child link="upper"/>
    <origin xyz="0 0 1" rpy="0 0 0.5"/>
    <axis xyz="0 0 1"/>
    <limit lower="-1" upper="2" effort="1" velocity="3"/>
  </joint>
  <joint name="hold" type="fixed">
    <parent link="upper"/>
    <child link="tool"/>
  </joint>
</robot>"""


@pytest.mark.parametrize(("change", "says"), [
    (('<child link="tool"/>', '<child link="upper"/>'), r"x:12: joint 'hold' has the child 'upper' .*line 5: "),
    (('<link name="tool"/>', '<link name="upper"/>'), r"x:4: link 'upper' is defined twice, first on line 3"),
    (('rpy="0 0 0.5"', 'rpy="0 0"'), r'x:8: rpy="0 0" of <origin> must be three numbers'),
    (('xyz="0 0 1" rpy', 'xyz="0 nan 1" rpy'), r'x:8: xyz="0 nan 1" of <origin> must be three numbers'),
    (('velocity="3"', 'velocity="-3"'), r"x:10: the velocity limit of joint 'turn' is -3: it must not be negative"),
    (('lower="-1"', 'lower="nan"'), r"x:10: the lower limit 'nan' of joint 'turn' is not a number"),
    (('effort="1"', 'effort="nan"'), r"x:10: the effort limit 'nan' of joint 'turn' is not a number"),
    (('<limit', '<dynamics damping="thick"/><limit'), r"x:10: the damping 'thick' of joint 'turn' must be a"),
    (('<limit', '<dynamics friction="-1"/><limit'), r"x:10: the friction '-1' of joint 'turn' .* not negative"),
    (('xyz="0 0 1" rpy', 'xyz="0 1e308 1" rpy'), r"x:8: .* must be three numbers \(none beyond 1e\+13\)"),
])  # fmt: skip
def test_what_is_wrong_is_told_by_its_line(change, says):
    assert len(joints(parse(ARM, "x"))) == 2
    wrong = ARM.replace(*change)
    assert wrong != ARM
    with pytest.raises(RaffError, match=says):
        parse(wrong, "x")


def test_a_kinematic_cycle_is_refused():
    ring = ARM.replace('<parent link="base"/>', '<parent link="tool"/>')
    with pytest.raises(RaffError, match="link 'upper' is not connected to the root, but part of a kinematic cycle"):
        parse(ring, "x")
    with pytest.raises(RaffError, match="every link has a parent"):
        parse(ring.replace('<link name="base"/>', ""), "x")


@pytest.mark.parametrize(("limit", "allowed", "fastest"), [
    ('<limit lower="-1" upper="2" velocity="3"/>', (-1.0, 2.0), 3.0),
    ('<limit lower="-1"/>', (-1.0, 0.0), None),
    ('<limit effort="1" velocity="0"/>', None, None),
    ("", None, None),
    ('<limit lower="-1e9" upper="1e9" velocity="1e9"/>', None, None),
    ('<limit lower="-inf" upper="inf" velocity="inf"/>', None, None),
    ('<limit lower="2" upper="inf" velocity="0"/>', (2.0, 1e9), None),
    ('<limit lower="-1e308" upper="2"/>', (-1e9, 2.0), None),
])  # fmt: skip
def test_limits_that_are_left_out_or_beyond_all_measure_are_none(limit, allowed, fastest):
    text = ARM.replace('<limit lower="-1" upper="2" effort="1" velocity="3"/>', limit)
    turn = joints(parse(text, "x"))[0]
    assert limits(turn) == allowed
    assert velocity(turn) == fastest


def test_a_joint_stands_at_zero_or_inside_its_limits():
    assert [default_value(allowed) for allowed in (None, (-1.0, 2.0), (1.0, 2.0))] == [0.0, 0.0, 1.5]
    assert [default_value(allowed) for allowed in ((2.0, 1e9), (-1e9, -3.0))] == [3.0, -4.0]


def test_a_long_chain_is_checked_in_no_time():
    """It took the square of its length."""
    links = "".join(f'<link name="l{i}"/>' for i in range(3000))
    held = (
        f'<joint name="j{i}" type="fixed"><parent link="l{i - 1}"/><child link="l{i}"/></joint>' for i in range(1, 3000)
    )
    assert len(joints(parse(f'<robot name="r">{links}{"".join(held)}</robot>', "x"))) == 2999
