"""Slips in URDFs that have one meaning are read so, with a note."""

import pytest

import cinegen

ARM = """<robot name="arm">
  <link name="base"><visual><geometry>
    <mesh filename="nowhere.stl" scale="2 2 2"/></geometry></visual></link>
  <link name="tip"/>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="tip"/><origin xyz="0.1 0 -0.7" rpy="0 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="2" velocity="3" effort="4"/>
  </joint>
</robot>
"""


@pytest.mark.parametrize(("before", "after", "note"), [
    ("0.1 0 -0.7", "0.1, 0, -0.7", 'xyz="0.1, 0, -0.7" of <origin> on line 6: commas between numbers are left out'),
    ('scale="2 2 2"', 'scale="2 2 2 1"', 'scale="2 2 2 1" of <mesh> on line 3: the first three factors are read'),
])  # fmt: skip
def test_what_has_one_meaning_is_read(before, after, note):
    written, meant = cinegen.load(ARM.replace(before, after)), cinegen.load(ARM)
    assert written.source.notes == (*meant.source.notes, note)
    assert written.placement(written.q_home, "tip") == meant.placement(meant.q_home, "tip")


def test_a_speed_or_an_effort_of_less_one_is_no_limit():
    arm = cinegen.load(ARM.replace('velocity="3"', 'velocity="-1.0"').replace('effort="4"', 'effort="-1"'))
    assert arm.limits["turn"] == (-1.0, 2.0, float("inf"), float("inf"))
    assert arm.source.notes == ('velocity="-1.0" of <limit> on line 7 and 1 more: -1 is read as no limit',)


def test_commas_may_be_decimal_ones():
    with pytest.raises(cinegen.CinegenError, match=r'xyz="0,1 0 -0,7" of <origin> must be three numbers'):
        cinegen.load(ARM.replace("0.1 0 -0.7", "0,1 0 -0,7"))
