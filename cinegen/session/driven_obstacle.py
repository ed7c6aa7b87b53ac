"""`DrivenObstacle`: an obstacle of a session that users drag."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.clearance import Clearance
from cinegen.collision.obstacle import Obstacle
from cinegen.ik import Solver
from cinegen.mission.drawn_obstacle import DrawnObstacle
from cinegen.model import Mechanism
from cinegen.model.mechanism_model import MechanismSource
from cinegen.planning.clearance_barrier import ClearanceBarrier, is_clear
from cinegen.session.avoiding import AvoidingRobot
from cinegen.session.robot import DrivenRobot, UserTask
from cinegen.session.state import ObstacleState, RobotStatus

_NEAREST = 0.5  # of the safety distance: it does not come nearer

_JOINTS: dict[int, tuple[tuple[str, Any], ...]] = {
    0: (),
    3: (("x", pin.JointModelPX), ("y", pin.JointModelPY), ("angle", pin.JointModelRZ)),
    6: (("free", pin.JointModelFreeFlyer),),
}


class DrivenObstacle(DrivenRobot):
    """An obstacle, which pushes the robot: the robot yields when the obstacle comes nearer than the safety distance;
    where the robot can't yield, the obstacle stops at half of that. Dragging does not rotate it.

    A solver moves it as a single free body, whose only node has its name.

    Args:
        name: name in the session.
        drawn: the obstacle.
        dt: period of a tick, s.
    """

    _least_rotation = 3

    def __init__(self, name: str, drawn: DrawnObstacle, dt: float) -> None:
        super().__init__(name, Solver(_free_body(name, drawn.dof), dt))
        self.base = drawn.placement.copy()
        self._meets: tuple[int, AvoidingRobot, Clearance, ClearanceBarrier] | None = None

    def meet(self, robot: AvoidingRobot, number: int, obstacle: Obstacle) -> None:
        """Let a robot avoid it.

        Args:
            robot: robot of the scene.
            number: index of the obstacle in the scene.
            obstacle: the obstacle in the scene.
        """
        joint = self.mechanism.model.frames[self.mechanism.frame_id(self.name)].parentJoint
        pieces = [replace(piece, joint=joint) for piece in obstacle.pieces]
        links = [Obstacle(body.name, (replace(body, joint=0, placement=pin.SE3.Identity()),)) for body in robot.bodies]
        clearance = Clearance(self.mechanism, pieces, links)
        barrier = ClearanceBarrier(clearance, _NEAREST * robot.safety)
        self.solver.barriers = (barrier,)
        self._meets = number, robot, clearance, barrier

    @property
    def pose(self) -> pin.SE3:
        """Pose in the session's world (m)."""
        return self.placement(self.name)

    @pose.setter
    def pose(self, pose: pin.SE3) -> None:
        relative = self.base.actInv(pose)
        if self.mechanism.floating:
            self.jump_to(pin.SE3ToXYZQUAT(relative))
        elif self.mechanism.mobility:
            self.jump_to(np.array([*relative.translation[:2], pin.log3(relative.rotation)[2]]))
        self._report_pose(jumps=True)

    def set_target(self, task: UserTask, target: pin.SE3) -> None:
        """See `DrivenRobot`: an obstacle that moves in a plane stays in it."""
        super().set_target(task, target)
        if not self.mechanism.floating:
            placement = self.mechanism.placement(self.q, task.task.node) * task.task.offset
            in_plane = task.task.target.copy()
            in_plane.translation[2] = placement.translation[2]
            task.task.target = in_plane

    def tick(self, dt: float) -> str:
        """See `DrivenRobot`; nothing is computed while it is at rest without tasks."""
        if not self.tasks and self.motion is None and self.step.status.name == "IDLE":
            return ""
        self._update_links()
        problem = super().tick(dt)
        self._report_pose()
        return problem

    def jump_to(self, q: Array) -> None:
        """See `DrivenRobot`."""
        super().jump_to(q)
        self._report_pose()

    def collision(self, q: Array) -> str:
        """See `DrivenRobot`."""
        self._update_links()
        if self._meets is None or np.array_equal(q, self.q):
            return ""
        _, _, clearance, barrier = self._meets
        if is_clear(clearance, self.q, q, barrier.safety):
            return ""
        return f"it would hit '{clearance.names(int(clearance.distances(q).argmin()))[1]}'"

    def status(self) -> RobotStatus:
        """See `DrivenRobot`."""
        status = super().status()
        if self._meets is not None and self.motion is None and status.name == "BARRED":
            _, _, clearance, barrier = self._meets
            rows = [row for row in self.step.active_barriers if row < len(barrier.pairs)]
            if rows:
                link = clearance.names(int(barrier.pairs[rows[0]]))[1]
                return RobotStatus(status.name, f"barred by '{link}'", status.description)
        return status

    def obstacle_state(self) -> ObstacleState:
        """Return the state, with targets in the session's world."""
        robot = self.state()
        tasks = tuple(msgspec.structs.replace(task, target=self.base * task.target) for task in robot.tasks)
        return ObstacleState(self.pose, tasks, robot.status)

    def _update_links(self) -> None:
        """Move the robot's bodies to their present poses in the clearance."""
        if self._meets is not None:
            _, robot, clearance, _ = self._meets
            for number, placement in enumerate(robot.link_placements()):
                clearance.move(number, self.base.actInv(placement))

    def _report_pose(self, jumps: bool = False) -> None:
        """Report the pose to the robot; `jumps`: it was put there."""
        if self._meets is not None:
            number, robot, _, _ = self._meets
            robot.move_obstacle(number, self.pose, jumps)


def _free_body(name: str, dof: int) -> Mechanism:
    """Return the mechanism of a single body that moves freely (6 DoF), in the horizontal plane (3), or not at all."""
    model, parent = pin.Model(), 0
    for joint, kind in _JOINTS[dof]:
        parent = model.addJoint(parent, kind(), pin.SE3.Identity(), joint)
    model.addFrame(pin.Frame(name, parent, pin.SE3.Identity(), pin.FrameType.BODY))
    model.lowerPositionLimit[:], model.upperPositionLimit[:], model.velocityLimit[:] = -np.inf, np.inf, np.inf
    joints = tuple(joint for joint, _ in _JOINTS[dof]) if dof == 3 else ()
    return Mechanism(
        name=name, model=model, nodes=(name,), joints=joints, actuated=joints, loops=(), length=1.0, floating=dof == 6,
        q_home=pin.neutral(model), cluster_ranks=(), gap_as_written=0.0, sensors={}, sensor_constraints=(),
        source=MechanismSource("", None, None, name),
    )  # fmt: skip
