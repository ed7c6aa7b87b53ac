"""URDFs in xacro are expanded by the package xacro."""

import re
import sys

import numpy as np
import pytest
from urdf_text import joint_text, links, robot

import cinegen
import raff2urdf
from raff2urdf import readers
from raff2urdf.errors import RaffError
from raff2urdf.urdf2raff.cli import main as urdf2raff

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
def bars(text_file):
    text_file("bar.xacro", BAR)
    return lambda name, text=BARS: text_file(name, text)


@pytest.mark.parametrize("name", ["bars.urdf.xacro", "bars.xacro", "bars.urdf"])
def test_macros_and_included_files_are_expanded(name, bars):
    description = readers.read(bars(name))
    assert 'xyz="1.0 0 0"' in description.urdf
    assert [loop["name"] for loop in description.constraints["loops"]] == ["pin"]
    assert description.constraints["loops"][0]["first"]["placement"][0][3] == 0.5


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
])  # fmt: skip
def test_what_xacro_refuses_is_told(element, says, bars):
    path = bars("wrong.xacro", f'<robot name="w" xmlns:xacro="http://www.ros.org/wiki/xacro">{element}</robot>')
    with pytest.raises(RaffError, match=rf"wrong\.xacro: .*{says}"):
        readers.read(path)


def test_packages_are_found_as_for_meshes_without_ros(bars, tmp_path, typed):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/bar.xacro").write_text(BAR)
    bars_open = BARS.replace("loop_joint", "frame")
    path = bars("1/2/3/b/urdf/bars.urdf.xacro", bars_open.replace("bar.xacro", "$(find bars)/bar.xacro"))
    said = typed("info", path, code=1)
    option = re.search(r"package 'bars' is not found: .* by (--package bars=)FOLDER \(in", said.err)[1]
    typed("info", path, *f"{option}{tmp_path / 'parts'}".split())
    assert cinegen.load(path, packages={"bars": tmp_path / "parts"}).mobility == 2
    (tmp_path / "1/2/3/b/package.xml").write_text("<package><name>bars</name></package>")
    (tmp_path / "1/2/3/b/bar.xacro").write_text(BAR)
    assert cinegen.load(path).mobility == 2


ARMS = """<robot name="arms" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="prefix" default="left_"/> <xacro:arg name="length" default="1"/>
  <link name="$(arg prefix)base"/> <link name="tip"/>
  <joint name="j" type="continuous">
    <parent link="$(arg prefix)base"/> <child link="tip"/> <origin xyz="$(arg length) $(arg height) 0"/>
  </joint>
</robot>"""


def test_arguments_are_given_and_missing_ones_proposed(bars, tmp_path, typed):
    path = bars("arms.xacro", ARMS)
    said = typed("info", path, code=1).err
    declared = 'the file declares prefix (default "left_"), length (default "1")'
    assert "the argument 'height' has no value: add --xacro-arg height=VALUE (in Python xacro_args={" in said
    assert declared in said
    option = re.search(r"add (--xacro-arg height=)VALUE", said)[1].split()
    typed("info", path, option[0], option[1] + "2")
    arms = cinegen.load(path, xacro_args={"height": "2", "prefix": "right_"})
    assert arms.nodes == ("right_base", "tip")
    np.testing.assert_allclose(arms.placement(arms.q_home, "tip").translation, [1.0, 2.0, 0.0])
    assert urdf2raff([str(path), "-o", f"{tmp_path}/", "--xacro-arg", "height=2"]) == 0
    assert raff2urdf.to_raff(path, xacro_args={"height": "2"}).joints


@pytest.mark.parametrize(("name", "options", "says"), [
    ("arms.xacro", "--xacro-arg height=2 --xacro-arg prefx=a", "prefx=a has no effect: .* did you mean 'prefix'"),
    ("plain.urdf", "--xacro-arg side=left", "side=left has no effect: .*plain.urdf has no argument 'side': leave"),
    ("delta4", "--xacro-arg side=left", "side=left has no effect: delta4 has no argument 'side': leave it out"),
    ("plain.urdf", "--package parts=.", "parts=. has no effect: .*plain.urdf names no package 'parts': .*part"),
    ("plain.urdf", "--package part=nowhere", "--package part=nowhere: there is no such folder: name the folder"),
    ("plain.urdf", "--swap-limits", "--swap-limits has no effect: no joint of .*plain.urdf has a lower limit above"),
])  # fmt: skip
def test_an_option_without_effect_is_refused(name, options, says, bars, typed, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    bars("arms.xacro", ARMS)
    mesh = '<visual><geometry><mesh filename="package://part/a.stl"/></geometry></visual>'
    bars("plain.urdf", f'<robot name="plain"><link name="a">{mesh}</link></robot>')
    for command in ("info", "sensors"):
        assert re.search(says, typed(command, name, *options.split(), code=1).err)
    if "." in name:
        assert urdf2raff([name, *options.split()]) == 1
        assert re.search(says, capsys.readouterr().err)


def test_an_option_needs_an_effect_on_one_of_several_files(bars, typed):
    arms, others = bars("arms.xacro", ARMS), bars("others.xacro", ARMS.replace("prefix", "side"))
    options = ["--xacro-arg", "height=2", "--xacro-arg", "prefix=a_", "--xacro-arg", "side=b_"]
    typed("info", arms, others, *options)
    assert "arms.xacro, " in typed("info", arms, others, *options, "--xacro-arg", "wide=1", code=1).err


@pytest.mark.parametrize("argument", ["side", "=left", "side=left=right"])
def test_an_argument_is_a_name_and_a_value(argument, bars, typed):

    path = bars("arms.xacro", ARMS.replace("$(arg height)", "0").replace("prefix", "side"))
    said = typed("info", path, "--xacro-arg", argument, code=0 if argument.startswith("side=") else 2)
    assert ("write NAME=VALUE" in said.err) != argument.startswith("side=")


def test_a_file_of_macros_names_those_that_call_them(tmp_path, text_file, typed):
    xacro = '<robot {0} xmlns:xacro="http://www.ros.org/wiki/xacro">{1}</robot>'
    include = '<xacro:include filename="{}"/>'
    (tmp_path / "robots").mkdir()
    (tmp_path / "macros").mkdir()
    (tmp_path / "package.xml").write_text("<package><name>arms</name></package>")
    bar_file = tmp_path / "macros/bar.xacro"
    with_block = BAR.replace("parent at", "parent at:=0 color:=red *origin").replace('<origin xyz="${at}"/>', "")
    bar_file.write_text(with_block.replace("</joint>", '<xacro:insert_block name="origin"/></joint>'))
    said = typed("info", bar_file, code=1).err
    assert re.search(r"bar.xacro: defines macros only \('bar'\): load a file that calls them, by <xacro:include", said)
    lines = re.search(r"by (<.*>)", said)[1].replace('filename="bar', f'filename="{tmp_path}/macros/bar')
    for word, value in (("name", "tip"), ("parent", "base")):
        lines = lines.replace(f'{word}="..."', f'{word}="{value}"')
    written = text_file("written.xacro", xacro.format('name="it"', f'<link name="base"/>{lines}'))
    assert cinegen.load(written).joints == ("tip_joint",)
    written.unlink()
    bar_file.write_text(BAR)
    two = '<xacro:macro name="two"><xacro:bar name="b" parent="a" at="0 0 1"/></xacro:macro>'
    (tmp_path / "macros/two.xacro").write_text(xacro.format("", include.format("../macros/bar.xacro") + two))
    caller = tmp_path / "robots/two.urdf.xacro"
    calls = f'{include.format("$(find arms)/macros/two.xacro")}<link name="a"/><xacro:two/>'
    caller.write_text(xacro.format('name="two"', calls))
    assert f"load {caller}, which calls them" in typed("info", bar_file, code=1).err


def test_without_xacro_the_error_names_the_command_that_installs_it(text_file, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    path = text_file("bars.xacro", "<robot/>")
    with pytest.raises(RaffError, match=r'bars\.xacro: files in xacro need the package xacro: .*"cinegen\[xacro\]"'):
        readers.read(path)


def test_a_urdf_may_name_variables_of_the_environment(text_file, monkeypatch):
    mount = joint_text("mount", "base", "imu", '<origin xyz="$(optenv IMU_XYZ 0.1 0 0.2)"/>', "fixed")
    path = text_file("rover.urdf", robot(links("base", "imu"), mount))
    monkeypatch.delenv("IMU_XYZ", raising=False)
    rover = cinegen.load(path)
    assert rover.placement(rover.q_home, "imu").translation.tolist() == [0.1, 0.0, 0.2]
    monkeypatch.setenv("IMU_XYZ", "0 0 1")
    rover = cinegen.load(path)
    assert rover.placement(rover.q_home, "imu").translation.tolist() == [0.0, 0.0, 1.0]
