"""`DrivenObstacle`: an obstacle of a session, that people drag."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.clearance import Clearance
from cinegen.collision.scene import Obstacle
from cinegen.ik import Solver
from cinegen.model import Mechanism
from cinegen.planning.keep import Keep, is_clear, part_in
from cinegen.session.avoiding import AvoidingRobot
from cinegen.session.driven import Driven, Held

Array = NDArray[np.float64]

_NEARER = 0.5  # of the safety distance: nearer than that it does not come


class DrivenObstacle(Driven):
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
        links = [replace(body, joint=0) for body in robot.bodies]
        self._clearance = Clearance(mechanism, own, links)
        self._keep = Keep(self._clearance, _NEARER * robot.safety, part_in(dt))
        self.solver.barriers = (self._keep,)
        self._first = len(own)

    def take(
        self,
        number: int,
        node: str,
        who: str,
        label: str,
        at: pin.SE3 | None = None,
        freedoms: tuple[int, int] = (3, 3),
    ) -> Held:
        """See `Driven`: it is not turned by who holds it at a point."""
        return super().take(number, node, who, label, at, (freedoms[0], 3))

    def aim(self, held: Held, target: pin.SE3) -> None:
        """See `Driven`: what moves in the plane stays in it."""
        super().aim(held, target)
        if not self.mechanism.floating:
            here = self.mechanism.placement(self.q, held.task.node) * held.task.offset
            aim = held.task.target.copy()
            aim.translation[2] = here.translation[2]
            held.task.target = aim

    def stand(self, base: pin.SE3) -> None:
        """See `Driven`."""
        super().stand(base)
        self._tell()

    def tick(self, dt: float) -> str:
        """See `Driven`; nothing is done while nobody holds it."""
        if not self.held and self.motion is None and self.step.status.name == "IDLE":
            return ""
        self._look()
        trouble = super().tick(dt)
        self._tell()
        return trouble

    def put(self, q: Array) -> None:
        """See `Driven`."""
        super().put(q)
        self._tell()

    def hit(self, q: Array) -> str:
        """See `Driven`."""
        self._look()
        if np.array_equal(q, self.q) or is_clear(self._clearance, self.q, q, self._keep.safety):
            return ""
        pair = int(self._clearance.distances(q).argmin())
        return f"it would hit '{self._clearance.names(pair)[1]}'"

    def status(self) -> tuple[str, str]:
        """See `Driven`."""
        name, words = super().status()
        if self.motion is None and name == "BARRED":
            held = self._keep.held
            links = [self._clearance.names(int(held[row]))[1] for row in self.step.active_barriers if row < len(held)]
            return name, f"stopped by '{links[0]}'" if links else words
        return name, words

    def _look(self) -> None:
        """Where the robot's bodies are now."""
        for number, place in enumerate(self._robot.places(), self._first):
            self._clearance.move(number, self.base.actInv(place))

    def _tell(self) -> None:
        """The robot is told where it is now."""
        self._robot.meet(self._number, self.placement(self._node))
