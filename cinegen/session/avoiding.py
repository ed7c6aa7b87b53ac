"""`AvoidingRobot`: a robot of a session that avoids obstacles."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.body import Body
from cinegen.collision.clearance import clearance_of
from cinegen.collision.scene import Scene
from cinegen.errors import CinegenError
from cinegen.ik import Status
from cinegen.ik.tasks.described import RangeDescription, TaskDescription
from cinegen.joints import kinematic_data
from cinegen.planning import AvoidingSolver
from cinegen.planning.clearance_barrier import is_clear
from cinegen.session.motion import PATIENCE, JointMotion
from cinegen.session.robot import DescribedTask, DrivenRobot
from cinegen.session.state import Obstruction, RobotStatus

_AT_REST = 1e-3  # rad/s and m/s
_LAG = 0.5  # rad or characteristic lengths: a motion waits while the robot is farther behind
_PROGRESS = 0.98  # of the remaining distance
_STOPPED = 0.15  # s without progress: a joint motion says what stops it, and waits for the slider
_THERE = 1e-7  # rad or characteristic lengths: distance at which it has arrived
_NAMED = 2  # in a status, at most


class AvoidingRobot(DrivenRobot):
    """The robot of a scene. Tasks guide it around obstacles or up to them, and obstacles that come near push it away,
    within the limits of acceleration of `motion_limits`. Other motions are followed within these limits, too: they wait
    while the robot lags, and end where it can't go on.

    Args:
        name: name in the session.
        scene: its obstacles, and its initial configuration.
        obstacles: names of the scene's obstacles in the session.
        dt: period of a tick, s.
    """

    def __init__(self, name: str, scene: Scene, obstacles: Sequence[str], dt: float) -> None:
        self._clearance = clearance_of(scene)
        self._avoiding = AvoidingSolver(self._clearance, dt, scene.safety, scene.influence, scene.start)
        super().__init__(name, self._avoiding)
        self.safety = scene.safety
        self._obstacles = tuple(obstacles)
        self.bodies: tuple[Body, ...] = self._clearance.links
        self._data = kinematic_data(self.mechanism.model)
        self._nearest, self._waited = np.inf, 0.0  # distance from where a motion leads, and s without progress

    def move_obstacle(self, obstacle: int, placement: pin.SE3, jumps: bool = False) -> None:
        """Move an obstacle.

        Args:
            obstacle: its index in the scene.
            placement: its pose in the session's world (m).
            jumps: whether it was put there, instead of moved.
        """
        self._avoiding.move(obstacle, self.base.actInv(placement), jumps)

    def link_placements(self) -> Iterator[pin.SE3]:
        """Yield the pose of each of its bodies in the session's world (m)."""
        pin.forwardKinematics(self.mechanism.model, self._data, self.q)
        for body in self.bodies:
            yield self.base * self._data.oMi[body.joint] * body.placement

    def _advance(self, dt: float) -> str:
        """See `DrivenRobot`."""
        motion, solver = self.motion, self._avoiding
        if motion is None:
            solver.destination = None
            return super()._advance(dt)
        self._hold(self.locked)
        self._follow(False)
        destination = solver.destination
        if destination is None:
            destination, self._waited, self._nearest = self.q, 0.0, np.inf
        ended = False
        if self.mechanism.distance(self.q, destination) < _LAG:
            q = motion.advance(dt)
            if q is None:
                ended = True
            elif motion.jumps and not self.collision(q):
                solver.destination = q
                self.jump_to(q)
                return ""
            elif not np.array_equal(q, destination):
                destination, self._nearest = q, np.inf
        solver.destination = destination
        self.step = solver.step()
        self._retarget()
        remaining = self.mechanism.distance(self.q, destination)
        if ended and remaining < _THERE:
            self.motion = None
            return f"{self.name}: {motion.problem}" if motion.problem else ""
        if remaining < _THERE or remaining < _PROGRESS * self._nearest:
            self._nearest, self._waited = remaining, 0.0
        self._waited += dt
        is_joints = isinstance(motion, JointMotion)
        if remaining < _THERE or self._waited < (_STOPPED if is_joints else PATIENCE):
            return ""
        problem = self.collision(destination) or "obstacles block the path"
        if is_joints:
            solver.destination = None
            motion.block(self.q, problem)
            return ""
        self.motion = None
        return f"{self.name}: {problem}"

    def _made(self, id: int, description: TaskDescription) -> DescribedTask:
        """See `DrivenRobot`."""
        if isinstance(description, RangeDescription):
            raise CinegenError(
                f"{self.name} avoids obstacles, and may have to brake beyond a range: add the task itself instead"
            )
        return super()._made(id, description)

    def collision(self, q: Array) -> str:
        """See `DrivenRobot`."""
        start = self.q
        if np.array_equal(q, start) or is_clear(self._clearance, start, q, self.safety):
            return ""
        pair = int(self._clearance.distances(q).argmin())
        return f"'{self._clearance.names(pair)[0]}' would hit {self._what(pair)}"

    def contact(self, q: Array) -> str:
        """See `DrivenRobot`."""
        distances = self._clearance.distances(q)
        pair = int(distances.argmin()) if len(distances) else -1
        if pair < 0 or distances[pair] > 0.0:
            return ""
        return f"'{self._clearance.names(pair)[0]}' would touch {self._what(pair)} where it was"

    def status(self) -> RobotStatus:
        """See `DrivenRobot`; with the names of obstacles."""
        status = super().status()
        distances = self._clearance.distances(self.q)
        pair = int(distances.argmin()) if len(distances) else -1
        if pair >= 0 and distances[pair] <= 0.0:
            label = f"'{self._clearance.names(pair)[0]}' touches {self._what(pair)}"
            return RobotStatus("TOUCHING", label, "a link touches an obstacle or another link")
        if self.motion is not None:
            return status
        if status.name == "UNAVOIDABLE":
            what = self._threatening()
            stands = float(np.abs(self.step.v).max(initial=0.0)) < _AT_REST
            label = f"{'stopped' if stands else 'stopping'}: found no motion that avoids {what}"
            return RobotStatus(status.name, label, status.description)
        if self._avoiding.evaded is not None:
            what = repr(self._obstacles[self._avoiding.evaded])
            return RobotStatus("PUSHED", f"pushed by {what}", "an obstacle moves the robot")
        if status.name == "BARRED":
            return RobotStatus(status.name, f"barred by {self._listed(self._barring())}", status.description)
        if status.name == "IDLE" and self.step.active_barriers:
            return RobotStatus("PUSHED", f"pushed by {self._listed(self._barring())}", "an obstacle moves the robot")
        around = [self._obstacles[i] for i in self._avoiding.vortices.active if i < len(self._obstacles)]
        if status.name == "DETOUR" and around:
            return RobotStatus(status.name, f"detour around {self._listed(map(repr, around))}", status.description)
        return status

    def obstruction(self) -> Obstruction | None:
        """See `DrivenRobot`."""
        threat, pair = self._avoiding.threat, -1
        if self.motion is not None:
            return None
        if threat is not None:
            return self._obstruction(threat.pair, threat.points)
        distances = self._clearance.distances(self.q)
        if len(distances) and distances.min() <= 0.0:
            pair = int(distances.argmin())
        elif self.step.status is Status.BARRED:
            held = self._avoiding.barrier.pairs
            pair = next((int(held[row]) for row in self.step.active_barriers if row < len(held)), -1)
        if pair < 0:
            return None
        first, second, _ = self._clearance.nearest_points(pair)
        return self._obstruction(self._clearance.names(pair), np.array([first, second]))

    # --- names ---------------------------------------------------------------------------------------------------

    def _barring(self) -> list[str]:
        """Return names of what restricts the last step."""
        held = self._avoiding.barrier.pairs
        return [self._what(int(held[row])) for row in self.step.active_barriers if row < len(held)]

    def _obstruction(self, names: tuple[str, str], points: Array) -> Obstruction:
        """Return the obstruction of two bodies, by their nearest points (2, 3) in the robot's own world (m)."""
        first, second = (self.base.act(point).tolist() for point in points)
        return Obstruction(f"{names[0]} – {names[1]}", ((*first,), (*second,)))

    def _threatening(self) -> str:
        """Return what the collision is with that no motion was found to avoid."""
        assert self._avoiding.threat is not None
        return f"'{self._avoiding.threat.pair[1]}'"

    def _what(self, pair: int) -> str:
        """Return what a link meets in a pair."""
        group = int(self._clearance.groups[pair])
        if group < len(self._obstacles):
            return f"'{self._obstacles[group]}'"
        return f"its own '{self._clearance.names(pair)[1]}'"

    @staticmethod
    def _listed(names: Iterable[str]) -> str:
        return ", ".join(list(dict.fromkeys(names))[:_NAMED]) or "what is near"
