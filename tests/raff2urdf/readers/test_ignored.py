"""Elements that are not read are listed; none that could remove degrees of freedom is among them."""

import json
import warnings
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_like_names import names

from raff2urdf import readers
from raff2urdf.errors import RaffError
from raff2urdf.readers.ignored import ignored

HEAD = """<robot name="bars">
  <link name="ground"/> <link name="crank"/> <link name="rocker"/>
  <joint name="drive" type="continuous"> <parent link="ground"/> <child link="crank"/> </joint>
  <joint name="swing" type="continuous"> <parent link="ground"/> <child link="rocker"/> </joint>
"""
FIXED = "<joint name='j' type='fixed'><parent link='crank'/>"
ENDS = '<a link="crank"/><b link="rocker"/>'


def write(folder: Path, added: str) -> Path:
    path = folder / "bars.urdf"
    path.write_text(f"{HEAD}{added}\n</robot>")
    return path


@pytest.mark.parametrize(("added", "element"), [
    ("<transmission name='t'><type>t</type></transmission>", "robot/transmission"),
    ("<gazebo reference='crank'><material>Gazebo/Blue</material></gazebo>", "gazebo/material"),
    ("<gazebo><plugin name='p' filename='control.so'/></gazebo>", "gazebo/plugin"),
    ("<gazebo><joint name='a'><parent>world</parent><child>ground</child></joint></gazebo>", "gazebo/joint"),
    ("<ros2_control name='r' type='system'/>", "robot/ros2_control"),
    ("<ros2_control name='r'><joint name='drive'><state_interface/></joint></ros2_control>", "robot/ros2_control"),
    ("<sensor name='s'/>", "robot/sensor"),
    (f"<link name='x'><custom/></link>{FIXED}<child link='x'/></joint>", "link/custom"),
    ("<frame name='tool' link='crank'/>", "robot/frame"),
])  # fmt: skip
def test_elements_that_are_not_read_are_listed(added, element, tmp_path):
    path = write(tmp_path, added)
    readers.read(path)
    assert ignored(path) == [(element, 1, (5,))]


def test_loops_and_couplings_that_are_read_are_not_listed(tmp_path):
    loop = '<loop_joint name="pin" type="spherical"><link1 link="crank"/><link2 link="rocker"/></loop_joint>'
    frames = '<frame name="closing_a_1" link="crank"/><frame name="closing_a_2" link="rocker"/>'
    param = '<param name="mimic">drive</param>'
    control = f'<ros2_control name="r" type="system"><joint name="swing">{param}</joint><hardware/></ros2_control>'
    assert ignored(write(tmp_path, loop + frames + control)) == [("ros2_control/hardware", 1, (5,))]


def test_what_drives_joints_is_not_listed(tmp_path):
    transmission = "<transmission name='t'><joint name='drive'/><actuator name='m'/></transmission>"
    plugin = "<gazebo><plugin name='p' filename='libdiff_drive.so'><leftJoint>drive</leftJoint></plugin></gazebo>"
    control = "<ros2_control name='r'><joint name='drive'><command_interface name='c'/></joint></ros2_control>"
    assert ignored(write(tmp_path, transmission + plugin + control)) == []


def test_other_formats(root, tmp_path):
    path = tmp_path / "arm.sdf"
    path.write_text(
        '<sdf version="1.9"><model name="m"><link name="l"><collision name="c"/><visual name="v"/></link>\n'
        '<plugin name="p" filename="f"/></model></sdf>'
    )
    assert ignored(path) == [("link/collision", 1, (1,)), ("model/plugin", 1, (2,))]
    path = tmp_path / "arm.xml"
    path.write_text(
        '<mujoco><worldbody><light pos="0 0 1"/><body><geom size="1"/></body></worldbody><sensor/></mujoco>'
    )
    assert ignored(path) == [("worldbody/light", 1, (1,)), ("mujoco/sensor", 1, (1,))]
    for name in ("five_bar", "delta4"):
        assert ignored(root / "generated" / f"{name}.urdf") == []


def test_the_command_lists_them(tmp_path, capsys):
    from cinegen.cli import main

    path = write(tmp_path, 2 * "<sensor name='s'/>\n")
    assert main(["info", str(path), "--ignored"]) == 0
    assert capsys.readouterr().out.endswith("  not read:\n    2 <sensor> in <robot>, lines 5, 6\n")
    assert main(["info", str(path), "--ignored", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["ignored"] == [
        {"element": "robot/sensor", "number": 2, "lines": [5, 6]}
    ]
    assert main(["info", "four_bar", "--ignored"]) == 0
    assert capsys.readouterr().out.endswith("  everything is read\n")


# --- nothing that looks like a loop is dropped in silence --------------------------------------------------------


@settings(max_examples=300)
@given(name=names(), form=st.integers(0, 5), prefix=st.sampled_from(["", "drake:", "gz:", "my:"]))
def test_no_loop_like_element_is_dropped_in_silence(name, form, prefix, tmp_path_factory):
    """It is read, refused at its line, or warned of; and it is never in the list of what is ignored."""
    element = f"<{prefix}{name} name='e'>{ENDS}</{prefix}{name}>"
    added = [
        element,
        f"<extension>{element}</extension>",
        f"<gazebo>{element}</gazebo>",
        f"<gazebo reference='crank'><plugin name='p' filename='f'>{element}</plugin></gazebo>",
        f"<link name='more'>{element}</link>{FIXED}<child link='more'/></joint>",
        f"<ros2_control name='r' type='system'>{element}</ros2_control>",
    ][form]
    path = write(tmp_path_factory.mktemp("fuzz"), added)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = readers.read(path)
        told = bool(found.constraints and (found.constraints["loops"] or found.constraints.get("couplings")))
    except RaffError as error:
        told = f"bars.urdf:5: <{prefix}{name}> 'e'" in str(error)
    except UserWarning:
        told = True
    assert told, added
    assert not any(name in one.element for one in ignored(path))
