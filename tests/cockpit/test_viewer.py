"""`cinegen.Viewer` shows configurations in meshcat's viewer, from a server that only this user reaches."""

import base64
import re
import threading
from pathlib import Path

import numpy as np
import pinocchio as pin
import psutil
import pytest
import umsgpack
from meshcat.geometry import Sphere

import cinegen

COMMAND = re.compile(r"octet-binary;base64,([\w+/=]+)")


@pytest.fixture
def viewer(robot):
    with cinegen.Viewer(robot("delta4")) as viewer:
        yield viewer


def shown(viewer):
    """The newest transform (4, 4) of each path."""
    commands = map(umsgpack.unpackb, map(base64.b64decode, COMMAND.findall(viewer.meshcat.static_html())))
    moves = (one for one in commands if one["type"] == "set_transform")
    return {one["path"]: np.reshape(one["matrix"], (4, 4)).T for one in moves}


def test_nodes_are_where_pinocchio_has_them_in_metres(viewer):
    mechanism = viewer.mechanism
    q = mechanism.q_home + 0.05
    viewer.display(q)
    model, data = mechanism.model, mechanism.model.createData()
    pin.framesForwardKinematics(model, data, q)
    found = shown(viewer)
    np.testing.assert_array_equal(found["/meshcat/cinegen"], np.eye(4))
    for node in mechanism.nodes:
        expected = data.oMf[model.getFrameId(node)].homogeneous
        np.testing.assert_allclose(found[f"/meshcat/cinegen/:{mechanism.name}/:{node}"], expected, atol=1e-12)


def test_own_objects_are_shown_beside_the_robot_and_configurations_of_another_size_are_refused(viewer):
    viewer.meshcat["ball"].set_object(Sphere(0.1))
    viewer.meshcat["ball"].set_transform(pin.SE3(np.eye(3), np.ones(3)).homogeneous)
    np.testing.assert_array_equal(shown(viewer)["/meshcat/ball"][:3, 3], np.ones(3))
    with pytest.raises(cinegen.CinegenError, match="15 numbers"):
        viewer.display(np.zeros(3))


def test_its_server_is_for_this_machine_and_its_commands_for_this_user_and_nothing_is_left_of_it(viewer):
    port = int(viewer.meshcat.url().split(":")[2].split("/")[0])
    listening = [one.laddr for one in psutil.Process().net_connections() if one.status == psutil.CONN_LISTEN]
    assert {ip for ip, bound in listening if bound == port} == {"127.0.0.1"}
    socket = Path(viewer.meshcat.window.zmq_url.removeprefix("ipc://"))
    assert socket.parent.stat().st_mode & 0o077 == 0
    for _ in range(2):
        viewer.stop()  # again: nothing happens
    assert not socket.parent.exists()
    assert "cinegen viewer" not in [thread.name for thread in threading.enumerate()]
