"""A 3D mouse on a serial line moves a robot of a session; unplugged it comes to rest, plugged in again it goes on."""

import numpy as np
import pytest
from mouse_streams import magellan_motion
from played import PlayedMagellan, wait

from cinegen.session import SessionRunner, arrange

pytestmark = pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning")


def test_a_mouse_moves_the_node_that_it_is_switched_to(robot, tmp_path):
    device = PlayedMagellan(tmp_path / "mouse").plug()
    delta = robot("delta4")
    with SessionRunner(arrange({"delta": delta}, sensors=[f"1={device.path}"]), own_process=False) as runner:

        def height():
            return delta.placement(runner.state.robots["delta"].q, "platform").translation[2]

        def sensor():
            return next(one for one in runner.state.sensors if one.id == "1")

        wait(lambda: runner.state is not None and sensor().state.value == "live")
        for _ in range(2):
            begin = height()

            def risen(begin=begin):
                device.send(b"\x7fnoise\r" + magellan_motion((0, 300, 0, 0, 0, 0)))  # a line is noisy
                return height() > begin + 0.02

            wait(risen)
            device.unplug()
            wait(lambda: sensor().state.value in ("lost", "silent", "opening"))
            rest = []

            def rests(rest=rest):
                rest.append(height())
                return len(rest) > 100 and rest[-1] == rest[-100]

            wait(rests)
            (task,) = runner.state.robots["delta"].tasks
            assert np.linalg.norm(task.target.translation[2] - height()) < 1e-6  # held there
            device.plug()
            wait(lambda: sensor().state.value == "live", 20.0)
    device.unplug()
