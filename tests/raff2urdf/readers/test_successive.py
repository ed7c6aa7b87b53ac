"""Joints of several freedoms are the same motions as successive ones."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from raff2urdf.readers.loops import successive
from raff2urdf.readers.urdf import joints
from raff2urdf.readers.urdf_file import parse

BODY = """<robot name="r">
  <link name="base"/>
  <link name="arm"/>
  <link name="body"/>
  <joint name="first" type="prismatic">
    <parent link="base"/><child link="arm"/><axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
  <joint name="j" type="{kind}">
    <parent link="arm"/><child link="body"/><origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/><axis xyz="{axis}"/>
  </joint>
</robot>"""

angles = st.floats(-1.5, 1.5)


def replaced(kind, axis="0 0 1"):
    tree = parse(BODY.format(kind=kind, axis=axis), "x")
    assert successive.replace_compound(tree, "x", keep_root=True).keys() == {"j"}
    again = parse(etree.tostring(tree, encoding="unicode"), "x")
    model = pin.buildModelFromXML(etree.tostring(again, encoding="unicode"))
    return [joint.get("name") for joint in joints(again)][1:], model


def placement(model, names, values):
    data, q = model.createData(), pin.neutral(model)
    for name, value in zip(names, values, strict=True):
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 2:  # the cosine and the sine of an angle without limits
            q[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
        else:
            q[joint.idx_q] = value
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId("body")]


ORIGIN = pin.SE3(pin.rpy.rpyToMatrix(0.4, 0.5, 0.6), np.array([0.1, 0.2, 0.3]))


@given(st.tuples(*[angles] * 3), st.sampled_from(["0 0 1", "0 1 0", "1 0 0", "1 2 -3"]))
def test_a_planar_joint_slides_at_right_angles_to_its_axis_and_turns_about_it(values, axis):
    names, model = replaced("planar", axis)
    assert names == ["j_TX", "j_TY", "j_Z"]
    normal = np.array(axis.split(), dtype=float)
    normal /= np.linalg.norm(normal)
    moved = ORIGIN.inverse() * placement(model, names, values)
    assert abs(moved.translation @ normal) < 1e-12
    assert np.linalg.norm(moved.translation) == pytest.approx(np.hypot(*values[:2]), abs=1e-12)
    assert np.allclose(pin.log3(moved.rotation), values[2] * normal, atol=1e-12)


def test_a_floating_joint_that_frees_the_whole_robot_may_be_kept():
    text = BODY.format(kind="fixed", axis="0 0 1").replace('type="prismatic"', 'type="floating"')
    tree = parse(text, "x")
    assert successive.replace_compound(tree, "x", keep_root=True) == {}
    assert successive.replace_compound(tree, "x", keep_root=False).keys() == {"first"}
