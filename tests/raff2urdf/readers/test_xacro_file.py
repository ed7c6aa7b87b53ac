"""URDFs in xacro are expanded by the package xacro."""

import re
import sys

import pytest

import cinegen
from raff2urdf import readers
from raff2urdf.errors import RaffError

BARS = """<robot name="bars" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:include filename="bar.xacro"/>
  <xacro:property name="length" value="0.5"/>
  <link name="ground"/>
  <xacro:bar name="crank" parent="ground" at="0 0 0"/>
  <xacro:bar name="coupler" parent="crank" at="${2 * length} 0 0"/>
  <xacro:if value="true">
    <loop_joint name="pin" type="spherical"> <link1 link="ground" xyz="${length} 0 0"/> <link2 link="coupler"/>
    </loop_joint>
  </xacro:if>
</robot>
"""
BAR = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:macro name="bar" params="name parent at">
    <link name="${name}"/>
    <joint name="${name}_joint" type="continuous">
      <parent link="${parent}"/> <child link="${name}"/> <origin xyz="${at}"/> <axis xyz="0 0 1"/>
    </joint>
  </xacro:macro>
</robot>
"""


@pytest.fixture
def bars(tmp_path):
    pytest.importorskip("xacro")
    (tmp_path / "bar.xacro").write_text(BAR)

    def write(name, text=BARS):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize("name", ["bars.urdf.xacro", "bars.xacro", "bars.urdf"])
def test_macros_and_included_files_are_expanded(name, bars):
    found = readers.read(bars(name))
    assert 'xyz="1.0 0 0"' in found.urdf
    assert [loop["name"] for loop in found.constraints["loops"]] == ["pin"]
    assert found.constraints["loops"][0]["first"]["placement"][0][3] == 0.5


def test_a_sidecar_file_is_named_without_xacro(bars, tmp_path):
    path = bars("bars.urdf.xacro", BARS.replace("loop_joint", "frame"))
    (tmp_path / "bars.yaml").write_text("closed_loop: [[ground, coupler]]\ntype: [3d]\n")
    with pytest.raises(cinegen.ClosureError):  # the coupler is 1 m away from the ground, and stays there
        cinegen.load(path)
    (tmp_path / "bars.yaml").unlink()
    assert cinegen.load(path).mobility == 2


@pytest.mark.parametrize(("element", "says"), [
    ("<xacro:nope/>", "xacro: unknown macro name: xacro:nope"),
    ('<link name="${nope}"/>', "xacro: name 'nope' is not defined"),
    ('<xacro:include filename="gone.xacro"/>', "No such file or directory"),
    ('<xacro:arg name="side"/><link name="$(arg side)"/>', "xacro:arg: .* write <xacro:arg name=.side. default"),
])  # fmt: skip
def test_what_xacro_refuses_is_told(element, says, bars):
    path = bars("wrong.xacro", f'<robot name="w" xmlns:xacro="http://www.ros.org/wiki/xacro">{element}</robot>')
    with pytest.raises(RaffError, match=rf"wrong\.xacro: .*{says}"):
        readers.read(path)


ARMS = """<robot name="arms" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="prefix" default="left_"/> <xacro:arg name="length" default="1"/>
  <link name="$(arg prefix)base"/> <link name="tip"/>
  <joint name="j" type="continuous">
    <parent link="$(arg prefix)base"/> <child link="tip"/> <origin xyz="$(arg length) $(arg height) 0"/>
  </joint>
</robot>"""


@pytest.mark.parametrize(("name", "options", "says"), [
    ("arms.xacro", "--xacro-arg height=2 --xacro-arg prefx=a", "prefx=a has no effect: .* did you mean 'prefix'"),
    ("plain.urdf", "--xacro-arg side=left", "side=left has no effect: .*plain.urdf has no argument 'side': leave"),
    ("delta4", "--xacro-arg side=left", "side=left has no effect: delta4 has no argument 'side': leave it out"),
    ("plain.urdf", "--package parts=.", "parts=. has no effect: .*plain.urdf names no package 'parts': .*part"),
    ("plain.urdf", "--package part=nowhere", "--package part=nowhere: there is no such folder: name the folder"),
    ("plain.urdf", "--swap-limits", "--swap-limits has no effect: no joint of .*plain.urdf has a lower limit above"),
])  # fmt: skip
def test_an_option_without_effect_is_refused(name, options, says, bars, capsys, monkeypatch, tmp_path):
    from cinegen.cli import main
    from raff2urdf.urdf2raff.cli import main as urdf2raff

    monkeypatch.chdir(tmp_path)
    bars("arms.xacro", ARMS)
    mesh = '<visual><geometry><mesh filename="package://part/a.stl"/></geometry></visual>'
    bars("plain.urdf", f'<robot name="plain"><link name="a">{mesh}</link></robot>')
    commands = [lambda: main(["info", name, *options.split()]), lambda: main(["sensors", name, *options.split()])]
    commands += [lambda: urdf2raff([name, *options.split()])] * ("." in name)
    for command in commands:
        assert command() == 1
        assert re.search(says, capsys.readouterr().err)


@pytest.mark.parametrize("given", ["side", "=left", "side=left=right"])
def test_an_argument_is_a_name_and_a_value(given, bars, capsys):
    from cinegen.cli import main

    path = bars("arms.xacro", ARMS.replace("$(arg height)", "0").replace("prefix", "side"))
    assert main(["info", str(path), "--xacro-arg", given]) == (0 if given.startswith("side=") else 2)
    assert ("write NAME=VALUE" in capsys.readouterr().err) != given.startswith("side=")


def test_without_xacro_the_error_names_the_command_that_installs_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    path = tmp_path / "bars.xacro"
    path.write_text("<robot/>")
    with pytest.raises(RaffError, match=r'bars\.xacro: files in xacro need the package xacro: .*"cinegen\[xacro\]"'):
        readers.read(path)


def test_a_urdf_may_name_variables_of_the_environment(tmp_path, monkeypatch):
    pytest.importorskip("xacro")
    path = tmp_path / "rover.urdf"
    path.write_text(
        '<robot name="rover"><link name="base"/><link name="imu"/><joint name="mount" type="fixed">'
        '<parent link="base"/><child link="imu"/><origin xyz="$(optenv IMU_XYZ 0.1 0 0.2)"/></joint></robot>'
    )
    monkeypatch.delenv("IMU_XYZ", raising=False)
    rover = cinegen.load(path)
    assert rover.placement(rover.q_home, "imu").translation.tolist() == [0.1, 0.0, 0.2]
    monkeypatch.setenv("IMU_XYZ", "0 0 1")
    rover = cinegen.load(path)
    assert rover.placement(rover.q_home, "imu").translation.tolist() == [0.0, 0.0, 1.0]
