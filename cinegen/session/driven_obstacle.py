"""`DrivenObstacle`: an obstacle of a session, that people drag."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.clearance import Clearance
from cinegen.collision.obstacle import Obstacle
from cinegen.ik import Solver
from cinegen.model import Mechanism
from cinegen.planning.clearance_barrier import ClearanceBarrier, approach_fraction, is_clear
from cinegen.session.avoiding import AvoidingRobot
from cinegen.session.robot import DrivenRobot, UserTask
from cinegen.session.state import RobotStatus

Array = NDArray[np.float64]

_NEARER = 0.5  # of the safety distance: nearer than that it does not come


class DrivenObstacle(DrivenRobot):
    """Of the scene of a robot. It pushes the robot before it: the robot yields as it comes nearer than the safety
    distance, and where the robot can't yield, the obstacle stops at half of that. It is taken without being turned.

    Args:
        name: in the session.
        mechanism: that stands for it.
        obstacle: of the scene.
        number: its place in the scene.
        robot: that keeps clear of it.
        dt: s, a tick.
    """

    def __init__(
        self, name: str, mechanism: Mechanism, obstacle: Obstacle, number: int, robot: AvoidingRobot, dt: float
    ) -> None:
        super().__init__(name, Solver(mechanism, dt))
        self._number, self._robot = number, robot
        self._node = mechanism.nodes[-1]
        joint = mechanism.model.frames[mechanism.frame_id(self._node)].parentJoint
        own = [replace(piece, joint=joint) for piece in obstacle.pieces]
        links = [Obstacle(body.name, (replace(body, joint=0, placement=pin.SE3.Identity()),)) for body in robot.bodies]
        self._clearance = Clearance(mechanism, own, links)
        self._barrier = ClearanceBarrier(self._clearance, _NEARER * robot.safety, approach_fraction(dt))
        self.solver.barriers = (self._barrier,)

    def add_task(
        self,
        id: int,
        node: str,
        source: str,
        label: str,
        offset: pin.SE3 | None = None,
        dof: tuple[int, int] = (3, 3),
    ) -> UserTask:
        """See `DrivenRobot`: its orientation is always constrained."""
        return super().add_task(id, node, source, label, offset, (dof[0], 3))

    def set_target(self, task: UserTask, target: pin.SE3) -> None:
        """See `DrivenRobot`: an obstacle that moves in a plane stays in it."""
        super().set_target(task, target)
        if not self.mechanism.floating:
            here = self.mechanism.placement(self.q, task.task.node) * task.task.offset
            in_plane = task.task.target.copy()
            in_plane.translation[2] = here.translation[2]
            task.task.target = in_plane

    def set_base(self, base: pin.SE3) -> None:
        """See `DrivenRobot`."""
        super().set_base(base)
        self._tell()

    def tick(self, dt: float) -> str:
        """See `DrivenRobot`; nothing is done while nobody holds it."""
        if not self.tasks and self.motion is None and self.step.status.name == "IDLE":
            return ""
        self._look()
        trouble = super().tick(dt)
        self._tell()
        return trouble

    def jump_to(self, q: Array) -> None:
        """See `DrivenRobot`."""
        super().jump_to(q)
        self._tell()

    def collision(self, q: Array) -> str:
        """See `DrivenRobot`."""
        self._look()
        if np.array_equal(q, self.q) or is_clear(self._clearance, self.q, q, self._barrier.safety):
            return ""
        pair = int(self._clearance.distances(q).argmin())
        return f"it would hit '{self._clearance.names(pair)[1]}'"

    def status(self) -> RobotStatus:
        """See `DrivenRobot`."""
        status = super().status()
        if self.motion is None and status.name == "BARRED":
            pairs = self._barrier.pairs
            links = [self._clearance.names(int(pairs[i]))[1] for i in self.step.active_barriers if i < len(pairs)]
            if links:
                return RobotStatus(status.name, f"barred by '{links[0]}'", status.description)
        return status

    def _look(self) -> None:
        """Where the robot's bodies are now."""
        for number, place in enumerate(self._robot.places()):
            self._clearance.move(number, self.base.actInv(place))

    def _tell(self) -> None:
        """The robot is told where it is now."""
        self._robot.meet(self._number, self.placement(self._node))
