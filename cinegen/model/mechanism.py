"""`Mechanism`: any robot, serial, tree or closed, as a Pinocchio model with its loops. It never changes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import CinegenError, ClosureError, ConfigurationError, UnknownNameError
from cinegen.html import table
from cinegen.joints import translations
from cinegen.loops.closed_loops import ClosedLoops, LoopConstraint
from cinegen.loops.clusters import subsystems
from cinegen.loops.held_loops import HeldLoops
from cinegen.loops.screws import LoopScrews
from cinegen.model.jacobian import COMPONENTS, ExtendedJacobian
from cinegen.model.limits import Limits
from cinegen.model.masses import massless, unphysical
from cinegen.model.shapes import Shapes, collision_shapes, geometry_model, lost_meshes, visual_shapes
from cinegen.model.spherical import SphericalJoints
from cinegen.model.structure import Structure
from raff2urdf import closure
from raff2urdf.coupling import Coupling
from raff2urdf.open_loops import shown_gaps
from raff2urdf.readers.srdf import Srdf

_Result = TypeVar("_Result")

_MOST_MASKS = 64  # sets of locked joints whose columns are kept


class MechanismSource(NamedTuple):
    """The input that a mechanism was built from, see `cinegen.model.build.build`.

    Attributes:
        urdf: its text.
        constraints: everything that a URDF cannot express, as `raff2urdf.constraints` describes; None for a tree.
        folder: where the URDF's meshes are searched; None where it names them absolutely.
        name: the file's, for errors.
        dialects: in which loops and couplings are declared, such as "URDF+" or "mimic".
        notes: about what was read.
        srdf: the pairs of links that an SRDF disables; None without one.
        owner: the folder of the recording or map that holds all this: it has no access to graphics elsewhere. None
            where it is the robot's own file.
        packages: names and folders of ROS packages that the user gave, in which meshes are searched first.
    """

    urdf: str
    constraints: Mapping[str, Any] | None
    folder: str | None
    name: str
    dialects: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    srdf: Srdf | None = None
    owner: str | None = None
    packages: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Mechanism:
    """A mechanism; it never changes, and serves several threads at once. Made by `cinegen.load`.

    A model that a program builds may have any joint of Pinocchio but mimic joints. The kernels move revolute,
    prismatic, spherical and free joints themselves; for a model with others they call Pinocchio, which is slower.

    Attributes:
        name: of the robot.
        model: the tree as a Pinocchio model. Each joint is one number of q (rad, m), RAFF's theta or r; a free base is
            seven; a ball joint of `balls` is four, a quaternion x y z w. Find joints by name, since Pinocchio orders
            them differently.
        nodes: names of base, links and frames: base first, in file order.
        joints: names of all joints that move, in file order (not of a free base and `balls`).
        actuated: names of the actuated joints, in file order.
        loops: the joints that were cut.
        couplings: equations between joints, such as those of gears.
        length: characteristic length, m, which makes translations commensurable with angles.
        spherical: the ball joints that are one spherical joint of the model each, with a quaternion in q; None without.
        uncontrolled: passive joints that neither the loops nor the actuated joints determine.
        dependent: actuated joints that the loops and the others determine.
        held: joints that are locked where `held_q` has them, see `with_held`: none as loaded.
        held_q: (nq,) closed configuration in which they are locked.
        floating: whether the base can move; then q begins with its seven numbers.
        q_home: (nq,) the configuration as written, moved to where all loops are closed; read-only.
        cluster_ranks: number of independent equations (generic rank) of each cluster of loops and couplings, see
            `cinegen.loops.clusters`.
        gap_as_written: largest residual of a loop or coupling at the configuration as written, rad or characteristic
            lengths.
        sensors: the sensors of the file, by number, as the constraints file has them.
        sensor_constraints: node and sensors, for each node that may follow some.
        source: what it was built from.

    Raises:
        CinegenError: the model has a mimic joint.
    """

    name: str
    model: pin.Model
    nodes: tuple[str, ...]
    joints: tuple[str, ...]
    actuated: tuple[str, ...]
    loops: tuple[LoopConstraint, ...]
    length: float
    floating: bool
    q_home: Array
    cluster_ranks: tuple[int, ...]
    gap_as_written: float
    sensors: Mapping[int, Mapping[str, Any]]
    sensor_constraints: tuple[tuple[str, tuple[int, ...]], ...]
    source: MechanismSource
    couplings: tuple[Coupling, ...] = ()
    spherical: SphericalJoints | None = None
    uncontrolled: tuple[str, ...] = ()
    dependent: tuple[str, ...] = ()
    held: tuple[str, ...] = ()
    held_q: Array | None = None

    def __post_init__(self) -> None:
        self.q_home.flags.writeable = False
        for name, joint in zip(self.model.names, self.model.joints, strict=True):
            if joint.shortname() == "JointModelMimic":  # Pinocchio's Jacobians of loops would be wrong
                raise CinegenError(
                    f"joint '{name}' of {self.name} is a mimic joint, which is not supported: build the model with it "
                    "as an independent joint (mimic=False in Pinocchio)"
                )

    def __repr__(self) -> str:
        return f"<Mechanism {self.name[:60]}: {self._summary}>"

    @property
    def _summary(self) -> str:
        nodes, joints, loops = (
            f"{len(of)} {what}{'s' * (len(of) != 1)}"
            for of, what in ((self.nodes, "node"), (self.joints, "joint"), (self.loops, "loop"))
        )
        joints += f" ({len(self.actuated)} actuated)"
        joints += f", {len(self.balls)} ball joint{'s' * (len(self.balls) != 1)}" if self.balls else ""
        coupled = len(self.couplings)
        loops += f", {coupled} coupling{'s' * (coupled != 1)}" if coupled else ""
        return f"{nodes}, {joints}, {loops}, mobility {self.mobility}"

    def _repr_html_(self) -> str:
        rows = []
        for name, bounds in self.limits.items():
            kind = "prismatic" if self.is_prismatic(name) else "revolute"
            numbers = (f"{value:.4g}" for value in (self.q_home[self.q_index(name)], *bounds))
            rows.append([name, kind, *numbers, "yes" if name in self.actuated else ""])
        limits = ("lower", "upper", "velocity (rad/s, m/s)", "effort (N m, N)")
        headings = ("joint", "type", "home (rad, m)", *limits, "actuated")
        joints = table(f"{self.name}: {self._summary}", headings, rows)
        ends = [(loop.name, loop.kind.name.lower(), loop.first, loop.second) for loop in self.loops]
        equations = [(coupling.name, str(coupling)) for coupling in self.couplings]
        joints += table("loops", ("loop", "kind", "first node", "second node"), ends) if ends else ""
        return joints + (table("couplings (rad, m)", ("coupling", "equation"), equations) if equations else "")

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what builds a copy in another process: Pinocchio's constraint models can't be pickled."""
        from cinegen.model.build import build

        held = self.source, self.held, self.structure.held_at
        return (_held_copy, held) if self.held else (build, tuple(self.source))

    @cached_property
    def structure(self) -> Structure:
        """The loops as equations, ranks and sample configurations: for algorithms."""
        return Structure(self)

    @property
    def loop_rank(self) -> int:
        """Number of independent equations of all loops and couplings (generic rank)."""
        return sum(self.cluster_ranks)

    @property
    def balls(self) -> tuple[str, ...]:
        """Names of the ball joints that have a quaternion in q; they are passive."""
        return () if self.spherical is None else self.spherical.names

    @cached_property
    def successive(self) -> Mechanism:
        """The same mechanism with three revolute joints for each of `balls`; itself without any."""
        if self.spherical is None:
            return self
        from cinegen.model.build import build

        constraints = dict(self.source.constraints or {})
        home = self.spherical.to_successive(self.q_home)
        joints = self.spherical.successive.joints
        index = {n: j.idx_q for n, j in zip(self.spherical.successive.names, joints, strict=True) if j.nq == 1}
        written = {joint["name"]: joint for joint in constraints.get("joints", [])} or {name: {} for name in index}
        entries = [
            {**joint, "name": name, "home": float(home[index[name]]), "actuated": name in self.actuated}
            for name, joint in written.items()
        ]
        made = build(*self.source._replace(constraints={**constraints, "joints": entries, "balls": []}))
        made = replace(made, length=self.length)
        threes = [entry["joints"] for entry in constraints.get("balls", []) if entry["name"] in self.balls]
        made.structure.__dict__["screws"] = LoopScrews(made.structure.own_system(), made.q_home, threes)
        return made

    @property
    def mobility(self) -> int:
        """Degrees of freedom that loops and couplings leave, counted on random closed configurations."""
        return int(self.model.nv) - len(self.structure.held_columns) - self.loop_rank

    def columns_of(self, joint: str) -> list[int]:
        """Return the columns of a joint, a ball joint or a floating base (`base`) in every Jacobian.

        Raises:
            UnknownNameError: no such joint.
        """
        found = self._joint(joint)
        return list(range(found.idx_v, found.idx_v + found.nv))

    @cached_property
    def base(self) -> str | None:
        """Name of the joint of a floating base, for `lock` and limits; None where the base can't move."""
        return next(name for name in self.model.names if name != "universe") if self.floating else None

    @property
    def is_constrained(self) -> bool:
        """True if there are loops or couplings: joint values are not independent."""
        return bool(self.loops or self.couplings)

    @cached_property
    def constraint_names(self) -> tuple[str, ...]:
        """Names of the loops, then of the couplings."""
        return (*(loop.name for loop in self.loops), *(coupling.name for coupling in self.couplings))

    @property
    def gravity(self) -> Array:
        """(3,) acceleration of gravity that the file states, m/s^2, in the world; (0, 0, -9.81) unless it does."""
        return np.array(self.model.gravity.linear)

    @cached_property
    def limits(self) -> Limits:
        """Limits of position, velocity and effort, by joint name and as arrays; rad, m, s, N."""
        return Limits(self.model, self.joints)

    @cached_property
    def scale(self) -> Array:
        """(nv,) size of one dimensionless step: `length` (m) for translations, 1 rad for rotations; more for joints
        that only drive others, see `raff2urdf.coupling.coupled_scales`."""
        return self.structure.system.scale

    def with_held(self, joints: Iterable[str], q: Array) -> Mechanism:
        """Return the same mechanism with some joints locked where they are: motions, ranks and mobility are those of
        the mechanism in which they are fixed. Configurations, names and the scale stay the same.

        Args:
            joints: names of joints, ball joints or the floating base (`base`); all others are unlocked.
            q: (nq,) closed.

        Raises:
            UnknownNameError: no such joint.
        """
        held = tuple(dict.fromkeys(joints))
        columns = [column for joint in held for column in self.columns_of(joint)]
        here = np.array(q, dtype=float)
        system = HeldLoops(self.model, self.loops, self.length, self.couplings, columns, here)
        ranks = [closure.generic_rank(own, here[at])[0] if own.model.nv else 0 for own, at in subsystems(system)]
        return replace(self, held=held, held_q=here, cluster_ranks=tuple(ranks))

    @cached_property
    def drawn(self) -> tuple[pin.GeometryObject, ...]:
        """The visual shapes of all nodes; sticks are drawn for meshes that are lost, see `cinegen.model.shapes`."""
        return tuple(self._visual.objects)

    @cached_property
    def _visual(self) -> Shapes:
        return visual_shapes(self.model, self.source)

    @cached_property
    def visual(self) -> pin.GeometryModel:
        """The same as Pinocchio's viewers take it. Thousands of shapes take minutes."""
        return geometry_model(self.drawn)

    @cached_property
    def lost_meshes(self) -> str:
        """A sentence about the meshes that can't be found or, once it was drawn, not be read; empty without one."""
        return self._visual.lost if "_visual" in vars(self) else lost_meshes(self.source)

    @cached_property
    def _collision(self) -> Shapes:
        return collision_shapes(self.model, self.source)

    @cached_property
    def collision(self) -> pin.GeometryModel:
        """The collision shapes of all nodes, see `cinegen.model.shapes.collision_shapes`."""
        return geometry_model(self._collision.objects)

    @property
    def unchecked_links(self) -> Mapping[str, str]:
        """The links that no check of collisions covers, since meshes of them are lost, with the reasons."""
        return self._collision.unchecked

    @cached_property
    def massless(self) -> tuple[str, ...]:
        """The moving bodies whose mass is unknown: for each, the first of its links in `nodes`.

        A mass of 0 that the file states, such as that of the cross of a universal joint, is known. A body that a rigid
        loop joins to one with a mass is the same body, which was cut there.
        """
        return massless(self)

    @cached_property
    def unphysical(self) -> Mapping[str, str]:
        """The links whose stated inertia no body can have, each with the reason, see `Inertia.why_unphysical`."""
        return unphysical(self)

    @property
    def end(self) -> str:
        """The end effector, unless another node is named: the last node of the file."""
        return self.nodes[-1]

    # --- names ---------------------------------------------------------------------------------------------------

    def frame_id(self, node: str) -> int:
        """Return Pinocchio's index of a node's frame.

        Raises:
            UnknownNameError: no such node.
        """
        frame = self._frame_ids.get(node)
        if frame is None:
            raise UnknownNameError("node", node, self.nodes)
        return frame

    @cached_property
    def _frame_ids(self) -> dict[str, int]:
        return {node: self.model.getFrameId(node, pin.FrameType.BODY) for node in self.nodes}

    def _joint(self, joint: str) -> Any:
        if joint not in self._joint_ids:
            raise UnknownNameError("joint", joint, self.joints)
        return self.model.joints[self._joint_ids[joint]]

    @cached_property
    def _joint_ids(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.model.names) if i > 0}

    def q_index(self, joint: str) -> int:
        """Return the index of a joint's variable in q.

        Raises:
            UnknownNameError: no such joint.
        """
        return int(self._joint(joint).idx_q)

    def v_index(self, joint: str) -> int:
        """Return the index of a joint's velocity in v, which is its column in every Jacobian.

        Raises:
            UnknownNameError: no such joint.
        """
        return int(self._joint(joint).idx_v)

    def is_prismatic(self, joint: str) -> bool:
        """Return whether a joint is prismatic: its variable is in metres.

        Raises:
            UnknownNameError: no such joint.
        """
        return translations(self._joint(joint)) > 0

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """For each column of a Jacobian the joint it belongs to; a free base has six, `joint0.x` and so on, a ball
        joint three, such as `joint5.rx`."""
        names = [""] * self.model.nv
        for name, joint in zip(self.model.names, self.model.joints, strict=True):
            for i in range(joint.nv if name != "universe" else 0):
                first = 3 if joint.nv == 3 and not translations(joint) else 0
                names[joint.idx_v + i] = name if joint.nv == 1 else f"{name}.{COMPONENTS[first + i]}"
        return tuple(names)

    # --- configurations ------------------------------------------------------------------------------------------

    def configuration(self, values: Mapping[str, ArrayLike], q: ArrayLike | None = None) -> Array:
        """Return a configuration with some joints set by name.

        Args:
            values: joint name -> value, rad or m; of a ball joint a quaternion x y z w of any size but 0, of a free
                base its position and quaternion.
            q: (nq,) that gives the other joints; home unless given.

        Raises:
            UnknownNameError: no such joint.
            ConfigurationError: a number that is not finite, too few or too many of them, or q of the wrong shape.
        """
        full = self.structure.checked(self.q_home if q is None else q).copy()
        for name, value in values.items():
            joint = self._joint(name)
            if joint.nq == 1:
                full[joint.idx_q] = value
                continue
            numbers = np.asarray(value, dtype=float)
            if numbers.shape != (joint.nq,) or not numbers.any():
                raise ConfigurationError(f"joint '{name}' of {self.name} takes {joint.nq} numbers, not {value!r:.60}")
            full[joint.idx_q : joint.idx_q + joint.nq] = numbers
        return self.structure.normalized(self.structure.checked(full))

    def values(self, q: Array) -> dict[str, float | list[float]]:
        """Return the values of all joints in q (nq,) by name, rad or m; of ball joints the quaternion x y z w."""
        found: dict[str, float | list[float]] = {name: float(q[self.q_index(name)]) for name in self.joints}
        for name in self.balls:
            found[name] = [float(x) for x in q[self.q_index(name) : self.q_index(name) + 4]]
        return found

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
        """Return the configuration (nq,) at a part, 0 to 1, of the shortest path between two others; loops may open."""
        return np.asarray(pin.interpolate(self.model, start, end, part))

    # --- kinematics ----------------------------------------------------------------------------------------------

    def placement(self, q: ArrayLike, node: str) -> pin.SE3:
        """Return the pose of a node in the world, m.

        Args:
            q: (nq,).
            node: its name.

        Raises:
            UnknownNameError: no such node.
            ConfigurationError: q is no configuration.
        """
        data = self.structure.system.data
        frame = self.model.frames[self.frame_id(node)]
        pin.forwardKinematics(self.model, data, self.structure.checked(q))
        return data.oMi[frame.parentJoint] * frame.placement

    def jacobian(self, q: ArrayLike, node: str) -> Array:
        """Return the (6, nv) Jacobian of a node in its own frame: linear above angular velocity, m and rad.

        Raises:
            UnknownNameError: no such node.
            ConfigurationError: q is no configuration.
        """
        frame = self.frame_id(node)
        if self.model.nv == 0:  # Pinocchio would crash
            return np.zeros((6, 0))
        local = pin.ReferenceFrame.LOCAL
        jacobian = pin.computeFrameJacobian(
            self.model, self.structure.system.data, self.structure.checked(q), frame, local
        )
        return np.asarray(jacobian).reshape(6, self.model.nv)  # a single column comes without its second dimension

    def loop_residual(self, q: ArrayLike) -> Array:
        """Return the residual (rows,) of all loops, m and rad, in the first ends' axes (see `raff2urdf.residual`), and
        then of all couplings, in the unit of their equations (see `raff2urdf.coupling`)."""
        return self.structure.system.evaluate(self.structure.checked(q))[0] * self._loop_units

    def loop_jacobian(self, q: ArrayLike) -> Array:
        """Return the exact derivative (rows, nv) of `loop_residual` by the velocity, m and rad; loops may be open."""
        jacobian = self.structure.system.evaluate(self.structure.checked(q))[1]
        return jacobian * self._loop_units[:, None] / self.scale

    @cached_property
    def _loop_units(self) -> Array:
        components = [component for loop in self.loops for component in loop.components]
        of_loops = [1.0 if "r" in component else self.length for component in components]
        return np.array([*of_loops, *self.structure.system.coupling_sizes])

    def extended_jacobian(self, q: ArrayLike, nodes: Iterable[str] | str = ()) -> ExtendedJacobian:
        """Return the extended Jacobian (seed paper, figure 9): six rows for each node above the rows of all loops and
        couplings.

        Args:
            q: (nq,).
            nodes: whose Jacobians come first, each in its node's own frame.

        Returns:
            rows in m and rad, columns by m and rad. The entry of a joint that does not move what a row describes is
            exactly 0.

        Raises:
            UnknownNameError: no such node.
            ConfigurationError: q is no configuration.
        """
        nodes = [nodes] if isinstance(nodes, str) else list(nodes)
        blocks = [self.jacobian(q, node) for node in nodes]
        rows = [(node, component) for node in nodes for component in COMPONENTS]
        if self.is_constrained:
            blocks.append(self.loop_jacobian(q))
            rows += [(loop.name, component) for loop in self.loops for component in loop.components]
            rows += [(coupling.name, "q") for coupling in self.couplings]
        matrix = np.vstack(blocks) if blocks else np.zeros((0, self.model.nv))
        return ExtendedJacobian(matrix, tuple(rows), self.columns)

    def screw_matrix(self, q: Array, system: ClosedLoops | None = None) -> Array:
        """Return the screw matrix of all loops and couplings, (rows, nv + cut joints' velocities), dimensionless: its
        singular values do not depend on which joints were cut, see `cinegen.loops.screws`.

        Args:
            q: (nq,) with closed loops.
            system: the loops, if not the mechanism's own: their data is that at q afterwards.
        """
        system = self.structure.system if system is None else system
        return self.structure.screws.matrix(system, system.evaluate(q)[1])

    def loop_singular_values(self, q: ArrayLike) -> Array:
        """Return the singular values of `screw_matrix` at q (nq,), dimensionless, largest first, as many as its generic
        rank: `loop_rank`, and one for each degree of freedom of the joints that were cut."""
        if self.loop_rank == 0:
            return np.zeros(0)
        sigma = np.linalg.svd(self.screw_matrix(self.structure.checked(q)), compute_uv=False)
        return np.asarray(sigma[: self.loop_rank + self.structure.screws.cut])

    # --- loops ---------------------------------------------------------------------------------------------------

    def closure(self, q: ArrayLike) -> float:
        """Return the largest residual of all loops and couplings at q (nq,), in rad or characteristic lengths; 0
        without any."""
        return max(closure.gaps(self.structure.system, self.structure.checked(q)), default=0.0)

    def close(self, q: ArrayLike, locked: Iterable[str] = ()) -> Array:
        """Return the closed configuration that Gauss-Newton steps reach from q (`raff2urdf.closure.close`), a nearby
        one; joint limits are not considered.

        Args:
            q: (nq,) such as rounded or guessed values.
            locked: joints that keep their value. With all actuated joints this is forward kinematics, on the branch
                near q.

        Returns:
            (nq,), closed to 1e-12.

        Raises:
            ClosureError: not closed there; names the loops and couplings, and their gaps.
            UnknownNameError: no such joint.
            ConfigurationError: q is no configuration.
        """
        names = (locked,) if isinstance(locked, str) else tuple(locked)
        mask = self.structure.mask(names)
        start = np.asarray(q, dtype=float)
        if not self.is_constrained or start.shape != self.q_home.shape:
            return self.structure.checked(start).copy()
        closing = self.structure.closer.close(start, mask)
        if closing.closed:
            return closing.q
        self.structure.checked(start)
        gaps = (closure.gaps(self.structure.system, closing.q), shown_gaps(self.structure.system, closing.q))
        found = zip(self.constraint_names, *gaps, strict=True)
        listed = ", ".join(f"'{name}' by {shown}" for name, gap, shown in found if gap > closure.CLOSED)
        what = "loops and couplings" if self.couplings else "loops"
        condition = f" with {len(set(names))} joints locked" if names else ""
        raise ClosureError(f"{self.name} can't be closed from there{condition}: these {what} remain open: {listed}")

    def random_closed(self, count: int, seed: int = 0) -> list[Array]:
        """Return random closed configurations (nq,) along a walk from home: at most `count`, fewer where little can
        move. Joint limits are not considered."""
        rng, system, start = np.random.default_rng(seed), self.structure.system, self.structure.held_at
        if not self.is_constrained:
            return [system.integrate(start, rng.normal(size=self.model.nv)) for _ in range(count)]
        parts = subsystems(system)
        walks = [list(closure.closed_walk(own, start[at], count, seed + i)) for i, (own, at) in enumerate(parts)]
        idle = np.ones(self.model.nv)  # joints in no cluster; a single cluster has all joints
        idle[np.concatenate(system.columns)] = 0.0
        many = len(parts) > 1 or bool(self.held)
        found, steps = list[Array](), count if many and idle.any() else max(map(len, walks))
        for i in range(steps):
            q = system.integrate(start, idle * rng.normal(size=len(idle)))
            for (_, at), walk in zip(parts, walks, strict=True):
                if walk:
                    q[at] = walk[min(i, len(walk) - 1)]
            found.append(q)
        return found


def _held_copy(source: MechanismSource, held: tuple[str, ...], q: Array) -> Mechanism:
    """Return what `Mechanism.with_held` does, in another process."""
    from cinegen.model.build import build

    return build(*source).with_held(held, q)
