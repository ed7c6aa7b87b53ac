"""The axes of joints that the page is told of are those about or along which the nodes move."""

import numpy as np
import pinocchio as pin
import pytest

from cinegen.cockpit.build_messages import hello_message
from cinegen.session import Setup


@pytest.mark.parametrize("name", ["rx90", "delta4", "scara", "gough", "planetary_gear"])
def test_a_node_moves_about_its_axis_through_its_origin(robot, name):
    mechanism, step = robot(name), 1e-6
    (described,) = hello_message(Setup({name: mechanism}), name, 1).robots
    moved = [node for node in described.nodes if node.joint is not None]
    assert {node.joint for node in moved} == set(mechanism.joints)
    assert all(node.axis is None for node in described.nodes if node.joint is None)
    for node in moved:
        q, change = mechanism.q_home, np.zeros(mechanism.model.nv)
        change[mechanism.model.joints[mechanism.model.getJointId(node.joint)].idx_v] = step
        before, after = (
            mechanism.placement(there, node.name) for there in (q, pin.integrate(mechanism.model, q, change))
        )
        twist = pin.log6(before.actInv(after)).vector / step  # in the node's frame
        expected = [*node.axis, 0, 0, 0] if mechanism.is_prismatic(node.joint) else [0, 0, 0, *node.axis]
        assert twist == pytest.approx(np.array(expected), abs=1e-5)
