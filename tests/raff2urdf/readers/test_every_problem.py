"""Problems of a file that don't need each other are reported in one answer."""

import pytest

import raff2urdf
from cinegen.collision import SceneError, load_scene
from raff2urdf import RaffError

URDF = """<robot name="a"><link name="base"/><link name="arm"/>
<joint name="one" type="revolut"><parent link="bas"/><child link="arm"/></joint>
<joint name="two" type="fixed"><child link="arm"/></joint>
<joint name="three" type="prismatic"><parent link="arm"/><child link="hand"/><limit lower="2" upper="1"/></joint>
<link name="hand"><inertial><mass value="-1"/></inertial>
<visual><geometry><sphere radius="x"/></geometry></visual></link>
</robot>"""

SCENE = """robot = "planar_3r"
goal = { point = [0.5, 0.2] }
[[obstacle]]
kind = "spere"
[[obstacle]]
kind = "sphere"
point = [1, 1, 1]
radius = 0.1
radus = 1
colur = 2
"""


def test_a_urdf(tmp_path):
    path = tmp_path / "a.urdf"
    path.write_text(URDF, encoding="utf-8")
    with pytest.raises(RaffError) as found:
        raff2urdf.to_raff(path, tmp_path / "a.raff")
    said = str(found.value).splitlines()
    wanted = ("'revolut'", "'bas', which is not a link", "no <parent>", "limit", "mass", "radius")
    assert len(said) == len(wanted)
    assert all(part in line for part, line in zip(wanted, said, strict=True))


def test_an_sdf(tmp_path):
    path = tmp_path / "a.sdf"
    joints = '<joint name="one" type="revolut"/><joint name="two" type="fixed"><parent>bas</parent></joint>'
    path.write_text(f'<sdf version="1.9"><model name="a"><link name="base"/>{joints}</model></sdf>', encoding="utf-8")
    with pytest.raises(RaffError) as found:
        raff2urdf.to_raff(path, tmp_path / "a.raff")
    said = str(found.value).splitlines()
    assert [part in line for part, line in zip(("'revolut'", "'bas'"), said, strict=True)] == [True, True]


def test_a_scene(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(SCENE, encoding="utf-8")
    with pytest.raises(SceneError) as found:
        load_scene(path)
    said = str(found.value).splitlines()
    assert [part in line for part, line in zip(("'spere'", "'radus'", "'colur'"), said, strict=True)] == [True] * 3
