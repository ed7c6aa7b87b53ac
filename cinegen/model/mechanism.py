"""`Mechanism`: any robot, serial, tree or closed, as a constant Pinocchio model with its loops."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from cinegen.errors import ClosureError, ConfigurationError, UnknownNameError
from cinegen.joints import scalar_joints, translations
from cinegen.loops.close import Newton
from cinegen.loops.closed_loops import ClosedLoops, Loop
from cinegen.model.jacobian import COMPONENTS, ExtendedJacobian
from cinegen.model.limits import Limits
from cinegen.model.shapes import collision_shapes, shapes
from raff2urdf import closure

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Source(NamedTuple):
    """What a mechanism was built from, and by what."""

    build: Callable[..., Mechanism]
    urdf: str
    constraints: Mapping[str, Any] | None
    folder: str | None
    name: str


class Mechanism:
    """A mechanism, constant once loaded; configurations are values. Made by `cinegen.load`.

    Attributes:
        name: of the robot.
        model: the tree, as Pinocchio has it. One number of q per joint (rad, m), a free base apart: RAFF's own
            theta or r. Map joints by name: Pinocchio orders them its own way.
        q_home: (nq,) the written configuration with all loops closed.
        mobility: degrees of freedom that the loops leave, counted on random closed configurations.
        loops: the joints that were cut.
        loop_rank: how many loop rows are independent (generic rank).
        actuated: names of the joints that have a motor, in file order.
        joints: names of all joints that move, in file order (a free base apart).
        nodes: names of base, links and frames: base first, in file order.
        floating: whether the base can move (then q begins with its seven numbers).
        length: characteristic length, m: it makes translations commensurable with angles.
        scale: (nv,) size of one dimensionless step: `length` (m) for translations, 1 rad for rotations.
        limits: limits of position, velocity and effort, by joint name and as arrays.
        source: what it was built from: a URDF's text, and what that can't say.
        gap_as_written: how far the loops stood open in the file, without unit.
        sensors: the file's sensors, by number, as the constraints file has them.
        sensor_constraints: node and sensors, for each node that may follow some.
    """

    def __init__(
        self,
        name: str,
        model: pin.Model,
        nodes: Sequence[str],
        joints: Sequence[str],
        actuated: Sequence[str],
        loops: Sequence[Loop],
        length: float,
        floating: bool,
        source: Source,
    ) -> None:
        self.name = name
        self.model = model
        self.nodes = tuple(nodes)
        self.joints = tuple(joints)
        self.actuated = tuple(actuated)
        self.loops = tuple(loops)
        self.length = length
        self.floating = floating
        self.scale = _scale(model, length)
        self.limits = Limits(model, self.joints)
        self.source = source
        self._scratch = threading.local()
        self.q_home: Array = pin.neutral(model)  # until `load` has closed the loops
        self.loop_rank = 0
        self.gap_as_written = 0.0
        self.sensors: Mapping[int, Mapping[str, Any]] = {}
        self.sensor_constraints: tuple[tuple[str, tuple[int, ...]], ...] = ()

    def __repr__(self) -> str:
        joints, loops = len(self.joints), len(self.loops)
        counted = f"{joints} joint{'s' * (joints != 1)}, {loops} loop{'s' * (loops != 1)}"
        return f"<Mechanism {self.name}: {counted}, mobility {self.mobility}>"

    def __reduce__(self) -> tuple[Any, ...]:
        """Pinocchio's constraint models can't be pickled: a copy in another process is built from the texts."""
        build, *texts = self.source
        return build, tuple(texts)

    @property
    def mobility(self) -> int:
        """Degrees of freedom that the loops leave."""
        return int(self.model.nv) - self.loop_rank

    @property
    def system(self) -> ClosedLoops:
        """The loops as equations, with scratch data of this thread's own."""
        system: ClosedLoops | None = getattr(self._scratch, "system", None)
        if system is None:
            system = self._scratch.system = self.own_system()
        return system

    def own_system(self) -> ClosedLoops:
        """The loops as equations, with scratch data of the caller's own."""
        anchors = []
        for loop in self.loops:
            first, second = self._frame(loop.first), self._frame(loop.second)
            anchors.append(
                (
                    first.parentJoint,
                    first.placement * loop.first_placement,
                    second.parentJoint,
                    second.placement * loop.second_placement,
                )
            )
        return ClosedLoops(self.model, self.loops, anchors, self.length, self.scale)

    @cached_property
    def visual(self) -> pin.GeometryModel:
        """The shapes of all nodes, as Pinocchio reads them from the URDF.

        Raises:
            LoadError: a mesh can't be read.
        """
        return shapes(self.model, self.source.urdf, self.source.folder, self.source.name)

    @cached_property
    def collision(self) -> pin.GeometryModel:
        """The shapes with which the nodes can collide, see `cinegen.model.shapes.collision_shapes`.

        Raises:
            LoadError: a mesh can't be read.
        """
        return collision_shapes(self.model, self.source.urdf, self.source.folder, self.source.name)

    @property
    def end(self) -> str:
        """The node that a hand takes first: the one that a sensor may follow, else the last in the file."""
        return next((node for node, _ in self.sensor_constraints), self.nodes[-1])

    # --- names ---------------------------------------------------------------------------------------------------

    def frame_id(self, node: str) -> int:
        """Pinocchio's number of a node's frame.

        Raises:
            UnknownNameError: no such node.
        """
        frame = self._frame_ids.get(node)
        if frame is None:
            raise UnknownNameError("node", node, self.nodes)
        return frame

    @cached_property
    def _frame_ids(self) -> dict[str, int]:
        bodies = {f.name: i for i, f in enumerate(self.model.frames) if f.type == pin.FrameType.BODY}
        return {node: bodies[node] for node in self.nodes}

    def _frame(self, node: str) -> Any:
        return self.model.frames[self.frame_id(node)]

    def _joint(self, joint: str) -> Any:
        if joint not in self._joint_ids:
            raise UnknownNameError("joint", joint, self.joints)
        return self.model.joints[self._joint_ids[joint]]

    @cached_property
    def _joint_ids(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.model.names) if i > 0}

    def q_index(self, joint: str) -> int:
        """Where a joint's variable stands in q.

        Raises:
            UnknownNameError: no such joint.
        """
        return int(self._joint(joint).idx_q)

    def v_index(self, joint: str) -> int:
        """Where a joint's velocity stands in v, and its column in every Jacobian.

        Raises:
            UnknownNameError: no such joint.
        """
        return int(self._joint(joint).idx_v)

    def slides(self, joint: str) -> bool:
        """Whether a joint is prismatic: its variable is in metres.

        Raises:
            UnknownNameError: no such joint.
        """
        return translations(self._joint(joint)) > 0

    @cached_property
    def scalar_joints(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Where in q and in v the joints are that are one number each: all but a free base."""
        return scalar_joints(self.model)

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """For each column of a Jacobian the joint it belongs to."""
        names = [""] * self.model.nv
        for name, joint in zip(self.model.names, self.model.joints, strict=True):
            for i in range(joint.nv if name != "universe" else 0):
                names[joint.idx_v + i] = name if joint.nv == 1 else f"{name}.{COMPONENTS[i]}"
        return tuple(names)

    @cached_property
    def passive_columns(self) -> NDArray[np.intp]:
        """Columns of the joints without a motor in a Jacobian; never those of a base that can move."""
        passive = [self._joint(name) for name in self.joints if name not in self.actuated]
        return np.array([joint.idx_v + i for joint in passive for i in range(joint.nv)], dtype=np.intp)

    @cached_property
    def passive_rank(self) -> int:
        """How many of these columns of the loops' Jacobian are independent (generic rank): all, unless joints are left
        that motors and loops don't determine."""
        found = (closure.rank(self.system.evaluate(q)[1][:, self.passive_columns]) for q in self.samples)
        return max(found) if self.loops else 0

    def configuration(self, values: Mapping[str, float], q: ArrayLike | None = None) -> Array:
        """A configuration with some joints set by name: the others are as in q, at home unless given.

        Args:
            values: joint name -> value, rad or m.
            q: (nq,).

        Raises:
            UnknownNameError: no such joint.
            ConfigurationError: a number that is not finite, or q of the wrong shape.
        """
        full = self.checked(self.q_home if q is None else q).copy()
        for name, value in values.items():
            full[self.q_index(name)] = value
        return self.checked(full)

    def checked(self, q: ArrayLike) -> Array:
        """q as an array (nq,) of finite doubles.

        Raises:
            ConfigurationError: it is none.
        """
        full = np.asarray(q, dtype=float)
        if full.shape != (self.model.nq,):
            raise ConfigurationError(f"a configuration of {self.name} has {self.model.nq} numbers, not {full.shape}")
        if not np.isfinite(full).all():
            raise ConfigurationError(f"a configuration of {self.name} holds numbers that are not finite")
        return full

    # --- arithmetic of configurations ----------------------------------------------------------------------------

    def difference(self, start: ArrayLike, end: ArrayLike) -> Array:
        """Return the velocity (nv,) that leads from one configuration (nq,) to another in 1 s; rad/s and m/s."""
        return np.asarray(pin.difference(self.model, start, end))

    def scaled_difference(self, start: ArrayLike, end: ArrayLike) -> Array:
        """Return the `difference` (nv,) of two configurations in rad and characteristic lengths."""
        return self.difference(start, end) / self.scale

    def distance(self, start: ArrayLike, end: ArrayLike) -> float:
        """Return the largest motion of a joint between two configurations (nq,), in rad or characteristic lengths."""
        return float(np.abs(self.scaled_difference(start, end)).max(initial=0.0))

    def integrate(self, q: ArrayLike, step: ArrayLike) -> Array:
        """Return the configuration (nq,) reached from q (nq,) by a step (nv,) in rad and m."""
        return np.asarray(pin.integrate(self.model, q, step))

    def interpolate(self, start: ArrayLike, end: ArrayLike, part: float) -> Array:
        """Return the configuration (nq,) at a part, 0 to 1, of the shortest way between two others; loops apart."""
        return np.asarray(pin.interpolate(self.model, start, end, part))

    # --- kinematics ----------------------------------------------------------------------------------------------

    def placement(self, q: ArrayLike, node: str) -> pin.SE3:
        """Where a node is in the world.

        Args:
            q: (nq,).
            node: its name.

        Raises:
            UnknownNameError: no such node.
            ConfigurationError: q is no configuration.
        """
        data = self.system.data
        frame = self._frame(node)
        pin.forwardKinematics(self.model, data, self.checked(q))
        return data.oMi[frame.parentJoint] * frame.placement

    def jacobian(self, q: ArrayLike, node: str) -> Array:
        """(6, nv) Jacobian of a node in its own frame: linear above angular velocity, m and rad.

        Raises:
            UnknownNameError: no such node.
            ConfigurationError: q is no configuration.
        """
        frame = self.frame_id(node)
        if self.model.nv == 0:  # Pinocchio would crash
            return np.zeros((6, 0))
        local = pin.ReferenceFrame.LOCAL
        jacobian = pin.computeFrameJacobian(self.model, self.system.data, self.checked(q), frame, local)
        return np.asarray(jacobian).reshape(6, self.model.nv)  # a single column comes without its second dimension

    def loop_residual(self, q: ArrayLike) -> Array:
        """(rows,) how far each loop stands open: m and rad, in its first end's axes (see `raff2urdf.loops`)."""
        return self.system.evaluate(self.checked(q))[0] * self._loop_units

    def loop_jacobian(self, q: ArrayLike) -> Array:
        """(rows, nv) exact derivative of `loop_residual` by the velocity, m and rad, closed or open."""
        jacobian = self.system.evaluate(self.checked(q))[1]
        return jacobian * self._loop_units[:, None] / self.scale

    @cached_property
    def _loop_units(self) -> Array:
        components = [component for loop in self.loops for component in loop.components]
        return np.array([1.0 if "r" in component else self.length for component in components])

    def extended_jacobian(self, q: ArrayLike, nodes: Iterable[str] | str = ()) -> ExtendedJacobian:
        """The paper's matrix (figure 9): six rows for each node that is pulled, above the rows of all loops.

        Args:
            q: (nq,).
            nodes: whose Jacobians stand above, each in its node's own frame.

        Returns:
            rows in m and rad, columns by m and rad; a joint that does not move what a row says has exactly 0 there.

        Raises:
            UnknownNameError: no such node.
            ConfigurationError: q is no configuration.
        """
        nodes = [nodes] if isinstance(nodes, str) else list(nodes)
        blocks = [self.jacobian(q, node) for node in nodes]
        rows = [(node, component) for node in nodes for component in COMPONENTS]
        if self.loops:
            blocks.append(self.loop_jacobian(q))
            rows += [(loop.name, component) for loop in self.loops for component in loop.components]
        matrix = np.vstack(blocks) if blocks else np.zeros((0, self.model.nv))
        return ExtendedJacobian(matrix, tuple(rows), self.columns)

    # --- loops ---------------------------------------------------------------------------------------------------

    def closure(self, q: ArrayLike) -> float:
        """The largest residual of all loops at q, in rad and characteristic lengths; 0 without loops."""
        return max(self.system.gaps(self.checked(q)), default=0.0)

    def close(self, q: ArrayLike, locked: Iterable[str] = ()) -> Array:
        """The closed configuration that Gauss-Newton reaches from q: the shortest way, joint limits apart.

        Args:
            q: (nq,) such as rounded or guessed values.
            locked: joints that keep their value: with all actuated ones, this is forward kinematics on the branch
                that q is near to.

        Returns:
            (nq,), closed to 1e-12.

        Raises:
            ClosureError: not closed there; names the loops and their gaps.
            UnknownNameError: no such joint.
            ConfigurationError: q is no configuration.
        """
        names = (locked,) if isinstance(locked, str) else tuple(locked)
        newton: Newton | None = getattr(self._scratch, "newton", None)
        near = newton.close(q, names) if newton is not None else None
        if near is not None:
            return near
        start = self.checked(q)
        free = np.ones(self.model.nv, dtype=bool)
        for name in names:
            free[self.v_index(name)] = False
        if not self.loops:
            return start.copy()
        system = self.system
        self._expect_again(system, names, ~free)
        closing = closure.close(system, start, free)
        if not closing.closed:
            gaps = zip(self.loops, system.gaps(closing.q), strict=True)
            listed = ", ".join(f"'{loop.name}' by {gap:.2g}" for loop, gap in gaps if gap > closure.CLOSED)
            held = f" with {int((~free).sum())} joints locked" if not free.all() else ""
            raise ClosureError(f"{self.name} can't be closed from there{held}: open stay {listed} (rad or lengths)")
        return closing.q.copy()  # never what the caller gave

    def _expect_again(self, system: ClosedLoops, locked: tuple[str, ...], held: Mask) -> None:
        """From the second time on in this thread, loops are closed by what is compiled: once is no reason to wait."""
        scratch = self._scratch
        if not hasattr(scratch, "newton"):
            scratch.newton = None
        elif scratch.newton is None and self.model.nv > 0:
            scratch.newton = Newton(system, self.loop_rank)
        if scratch.newton is not None:
            scratch.newton.expect(locked, held)

    @cached_property
    def samples(self) -> tuple[Array, ...]:
        """A few closed configurations (nq,), home first: what holds on one of them holds generically."""
        return (self.q_home, *self.random_closed(3))

    def random_closed(self, count: int, seed: int = 0) -> list[Array]:
        """Closed configurations (nq,) along a random walk from home; fewer where little can move. Limits apart."""
        if self.loops:
            return list(closure.closed_walk(self.system, self.q_home, count, seed))
        rng = np.random.default_rng(seed)
        return [self.system.integrate(self.q_home, rng.normal(size=self.model.nv)) for _ in range(count)]


def _scale(model: pin.Model, length: float) -> Array:
    """(nv,) `length` where a velocity is a translation's, 1 where it is a rotation's."""
    scale = np.ones(model.nv)
    for joint in model.joints:
        scale[joint.idx_v : joint.idx_v + translations(joint)] = length
    return scale
