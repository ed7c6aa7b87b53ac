"""`TaskParts`: the joints that bring a node to a pose, as linkages that are solved one by one.

To fix a node at a pose is to add a loop from the base to the node with all joints of the mechanism passive: the pose is
given as the values of virtual joints from the base to a frame, to which the node is joined. So inverse solutions are
assembly modes of a mechanism whose actuated joints are virtual. With the node fixed, loops that share no joint with
others are independent of them, such as the legs of a parallel robot: each such part is solved by itself, and each
solution of one goes with each of the others.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.assembly.certify import Unknowns
from cinegen.assembly.chains import recognise_part
from cinegen.assembly.errors import FreeMotionError, ModesError
from cinegen.assembly.modes import ModesSolver
from cinegen.errors import ClosureError
from cinegen.inverse.driven_joints import DrivenJoints
from cinegen.inverse.motion_group import MotionGroup, generated
from cinegen.inverse.parts import NodeTask, TaskPart, VirtualPose
from cinegen.joints import kinematic_data
from cinegen.loops.closed_loops import ClosedLoops, LoopConstraint, linked
from cinegen.loops.clusters import subsystems
from cinegen.model import Mechanism
from cinegen.model.mechanism_model import MechanismSource
from raff2urdf import closure
from raff2urdf.coupling import Coupling
from raff2urdf.errors import raised_as
from raff2urdf.raff.document import LoopKind

_STILL = 1e-9  # rad, characteristic lengths: a joint that moves the node and the loops less does not move them
_WALK, _STEP = 3, 0.4  # configurations besides the first that motions are examined at; rad, characteristic lengths
_PARALLEL = 1e-6
_TASK = -(2**62)  # the task among the joints and the cuts, which are numbered 1, 2, ... and -1, -2, ...
_VIRTUAL = "virtual"


class TaskParts:
    """The parts of a mechanism that bring a node to poses.

    Args:
        mechanism: the mechanism; a free base stays where it is at home.
        task: the frame that is brought to poses.
        locked: values that joints keep, rad and m.

    Attributes:
        mechanism, task: as given.
        start: (nq,) home, with locked joints at their values.
        motions: the group that the node's motions from `start` generate.
        every: whether no motion of the joints, in any assembly mode, leaves this group.
        driven: the joints that move neither the node nor its loops, and are not locked.
        couplings: those that relate the joints of a part to each other; others only move idle joints.

    Raises:
        ModesError: no joint moves the node; locked values that can't be reached; a task that can't be solved so.
    """

    def __init__(self, mechanism: Mechanism, task: NodeTask, locked: Mapping[str, float]) -> None:
        self.mechanism, self.task = mechanism, task
        model, frame = mechanism.model, mechanism.model.frames[mechanism.frame_id(task.node)]
        self._root, self._end = (1 if mechanism.floating else 0), int(frame.parentJoint)
        self._kind, self.couplings = LoopKind.BALL, list[Coupling]()
        self.start = self._configuration(locked)
        self._locked = tuple(locked)
        self._samples = self._walk()
        data = kinematic_data(model)
        pin.forwardKinematics(model, data, self.start)
        self._at = [data.oMi[self._root].actInv(placement) for placement in data.oMi]
        self._frame = frame.placement * task.offset
        self._home = self._at[self._end] * self._frame
        self._frozen = {model.getJointId(name) for name in (*locked, *self._still())}
        path = [model.joints[j].idx_v for j in self._chain(self._end)]
        if not path:
            raise ModesError(f"{mechanism.name}: no joint moves '{task.node}'")
        self.couplings = self._related(self._names(self._split()))
        twists = [self._twists(q) @ self._motions(q, self.couplings) for q in self._samples]
        length, near = mechanism.length, self._home.translation
        self.motions = generated(np.hstack(twists), length, near)
        self.every = self.motions.dimension == generated(self._twists(self.start)[:, path], length, near).dimension
        self._kind, self._axis, self._virtual = self._closing()
        split = self._split()
        used = self._names(split)
        idle = tuple(name for name in mechanism.joints if name not in used and name not in locked)
        self.driven = DrivenJoints(mechanism, idle, self._in_loops, self._samples)
        self._parts = split

    @cached_property
    def parts(self) -> list[TaskPart]:
        """The parts.

        Raises:
            ModesError: joints of other kinds; the task leaves the mechanism DoF.
        """
        return [self._part(joints, cuts) for joints, cuts in self._parts]

    @cached_property
    def unknowns(self) -> Unknowns:
        """The unknowns of solutions: the joints of all parts, and those that couplings relate to them."""
        mechanism, parts = self.mechanism, self.parts
        moving = {name for part in parts for name in part.joints}
        moving.update(name for coupling in mechanism.couplings for name in coupling.terms)
        kept = {*self._locked, *self.driven.staying}
        names = tuple(name for name in mechanism.joints if name in moving and name not in kept)
        columns, units = [mechanism.v_index(name) for name in names], np.repeat([[mechanism.length], [1.0]], 3, axis=0)
        ranks = []
        for q in self._samples:
            task, loops = self._task_rows(q) * mechanism.scale, mechanism.structure.system.evaluate(q)[1]
            ranks.append(closure.rank(np.vstack([task / units[: len(task)], loops])[:, columns]))
        features = {feature: None for part in parts for feature in part.solver.body_features}
        real = tuple(feature for feature in features if not feature.joint.startswith(_VIRTUAL))
        return Unknowns(names, max(ranks), (*real, *self.driven.features))

    # --- the mechanism --------------------------------------------------------------------------------------------

    def _configuration(self, locked: Mapping[str, float]) -> Array:
        """Return home (nq,) with locked joints at their values."""
        mechanism = self.mechanism
        with raised_as(ModesError, ClosureError, "the values of locked joints can't be reached from home: "):
            return mechanism.close(mechanism.configuration(locked), tuple(locked))

    def _walk(self) -> list[Array]:
        """Return configurations (nq,) near `start`, with locked joints where they are."""
        rng, walk = np.random.default_rng(0), [self.start]
        for _ in range(_WALK):
            motions = self._motions(walk[-1], self.mechanism.couplings)
            step = motions @ rng.normal(size=motions.shape[1])
            step *= _STEP / max(float(np.abs(step / self.mechanism.scale).max(initial=0.0)), 1e-300)
            try:
                walk.append(self.mechanism.close(self.mechanism.integrate(walk[-1], step), self._locked))
            except ClosureError:
                break
        return walk

    def _motions(self, q: Array, couplings: Collection[Coupling]) -> Array:
        """Return the velocities (nv, dof) that the loops and some couplings allow at q (nq,), rad and m; locked joints
        are at rest."""
        mechanism = self.mechanism
        free = np.ones(mechanism.model.nv, dtype=bool)
        free[[mechanism.v_index(name) for name in self._locked]] = False
        free[: 6 * self._root] = False
        columns = np.eye(mechanism.model.nv)[:, free] * mechanism.scale[free]
        if not mechanism.is_constrained:
            return np.asarray(columns)
        jacobian = mechanism.loop_jacobian(q)[self.rows(couplings)] @ columns
        rank, rows = closure.rank(jacobian), np.linalg.svd(jacobian)[2]
        return np.asarray(columns @ rows[rank:].T)

    def _twists(self, q: Array) -> Array:
        """Return the Jacobian (6, nv) of the node relative to the root at q (nq,), in the root's axes, of the velocity
        of its origin; m and rad."""
        model, data = self.mechanism.model, self.mechanism.structure.system.data
        jacobian = np.asarray(pin.computeJointJacobians(model, data, q)).reshape(6, model.nv)
        columns = np.zeros_like(jacobian)
        for j in model.supports[self._end]:
            if j > self._root:
                moved = slice(model.joints[j].idx_v, model.joints[j].idx_v + model.joints[j].nv)
                columns[:, moved] = jacobian[:, moved]
        return np.asarray(data.oMi[self._root].toActionMatrixInverse() @ columns)

    def _still(self) -> list[str]:
        """Return the joints that move neither the task's equations nor the loops."""
        mechanism, moved = self.mechanism, np.zeros(self.mechanism.model.nv)
        equations = sum(loop.rows for loop in mechanism.loops)
        for q in self._samples:
            rows = np.vstack([mechanism.loop_jacobian(q)[:equations], self._task_rows(q)])
            moved = np.maximum(moved, np.abs(rows * mechanism.scale).max(axis=0))
        return [name for name in mechanism.joints if moved[mechanism.v_index(name)] < _STILL]

    def _task_rows(self, q: Array) -> Array:
        """Return the derivatives (rows, nv) of the task's equations at q (nq,), if q fulfils them; m and rad."""
        linear, angular = np.split(self._relative(q).toActionMatrixInverse() @ self._twists(q), 2)
        if self.task.rotation == 2:
            angular = pin.skew(np.array(self.task.free_axis)) @ angular
        return np.vstack([linear, angular]) if self.task.rotation else np.asarray(linear)

    def _relative(self, q: Array) -> pin.SE3:
        """Return the frame's placement in the root at q (nq,)."""
        data = self.mechanism.structure.system.data
        pin.forwardKinematics(self.mechanism.model, data, q)
        return data.oMi[self._root].actInv(data.oMi[self._end]) * self._frame

    # --- structure ------------------------------------------------------------------------------------------------

    def _carrier(self, body: int) -> int:
        """Return the first body towards the root that a joint which is not frozen moves; the root if there is none."""
        while body > self._root and body in self._frozen:
            body = int(self.mechanism.model.parents[body])
        return max(body, self._root)

    def _chain(self, body: int, fixed: int = -1) -> set[int]:
        """Return the joints that are not frozen from a body to the root, or to the body `fixed` if that comes first."""
        joints, body = set[int](), self._carrier(body)
        while body not in (self._root, fixed):
            joints.add(body)
            body = self._carrier(int(self.mechanism.model.parents[body]))
        return joints

    @cached_property
    def _in_loops(self) -> set[str]:
        """The names of joints in loops, without frozen ones."""
        cuts = self.mechanism.structure.system.anchors
        joints = set[int]().union(*(self._chain(a) ^ self._chain(b) for a, _, b, _ in cuts))
        return {self.mechanism.model.names[j] for j in joints}

    def _names(self, parts: list[tuple[set[int], set[int]]]) -> set[str]:
        """Return the names of the joints of all parts."""
        return {self.mechanism.model.names[j] for joints, _ in parts for j in joints}

    def _split(self) -> list[tuple[set[int], set[int]]]:
        """Return the joints and the cuts of each part."""
        anchors, end = self.mechanism.structure.system.anchors, self._carrier(self._end)
        cuts = {k: (int(a), int(b)) for k, (a, _, b, _) in enumerate(anchors)}
        cycles = [self._chain(a) ^ self._chain(b) | {-1 - k} for k, (a, b) in cuts.items()]
        index = self.mechanism.model.getJointId
        related = [{int(index(name)) for name in coupling.terms} for coupling in self.couplings]
        (whole,) = (group for group in _joined([*cycles, *related, self._chain(end) | {_TASK}]) if _TASK in group)
        parts = [whole]
        if self._kind is LoopKind.RIGID:  # the node is part of the base now
            above = self._carrier(int(self.mechanism.model.parents[end]))
            cycles = [
                self._chain(a, end) ^ self._chain(b, end) | {-1 - k} for k, (a, b) in cuts.items() if -1 - k in whole
            ]
            parts = _joined([*cycles, *related, self._chain(above) | {end}])
        return [({i for i in group if i >= 0}, {-1 - i for i in group if _TASK < i < 0}) for group in parts]

    def _closing(self) -> tuple[LoopKind, Array, MotionGroup]:
        """Return how the virtual joints' frame and the node are joined, the joint's axis (3,) in the frame, and the
        motions of the virtual joints."""
        motions, task = self.motions, self.task
        if task.rotation == 3 or motions.rotations == 0:
            return LoopKind.RIGID, np.array([0.0, 0.0, 1.0]), motions
        free = np.array(task.free_axis) / np.linalg.norm(task.free_axis)
        normal = self._home.rotation.T @ motions.axis
        if task.rotation == 2 and motions.rotations == 3:
            return LoopKind.REVOLUTE, free, motions
        if task.rotation == 2 and np.abs(np.cross(free, normal)).max() > _PARALLEL:
            raise ModesError(
                f"{self.mechanism.name}: '{task.node}' moves {motions.description}, which does not rotate it about the "
                "free axis: constrain all three rotations"
            )
        directions = motions.directions if len(motions.directions) > 1 else np.eye(3)
        translations = replace(motions, rotations=0, directions=directions)
        return (LoopKind.BALL if motions.rotations == 3 else LoopKind.REVOLUTE), normal, translations

    def _related(self, used: set[str]) -> list[Coupling]:
        """Return the couplings that relate joints of the parts to each other: none if other joints, such as those that
        drive them, fulfil all couplings whatever the values of the used ones."""
        mechanism, system = self.mechanism, self.mechanism.structure.system
        jacobians = [system.evaluate(q)[1] for q in self._samples]
        free = [mechanism.v_index(name) for name in mechanism.joints if name not in self._locked]
        others = [mechanism.v_index(name) for name in mechanism.joints if name not in (*self._locked, *used)]

        def relations(couplings: Collection[Coupling]) -> int:
            """Return how many equations of loops and couplings are between used joints: as many as others can't fulfil;
            generic ranks, as a cam may dwell at home."""
            rows = self.rows(couplings)
            every, by_others = (max(closure.rank(matrix[rows][:, at]) for matrix in jacobians) for at in (free, others))
            return every - by_others

        direct = [coupling for coupling in mechanism.couplings if coupling.terms.keys() <= used]
        count = relations(mechanism.couplings)
        if count == relations(()):
            return []
        if count > relations(direct):
            moving, first = {mechanism.v_index(name) for name in used}, len(mechanism.loops)
            related = (group for group, columns in linked(system.columns) if not moving.isdisjoint(columns.tolist()))
            names = ", ".join(f"'{mechanism.constraint_names[k]}'" for group in related for k in group if k >= first)
            raise ModesError(
                f"{mechanism.name}: couplings ({names}) relate joints that move '{self.task.node}' to others, or to "
                "locked ones: inverse solutions of these are not computed"
            )
        return direct

    def rows(self, couplings: Collection[Coupling]) -> list[int]:
        """Return the indices of the equations of all loops and of some couplings."""
        every = self.mechanism.couplings
        loops = self.mechanism.structure.system.rows - len(every)
        return [*range(loops), *(loops + k for k, coupling in enumerate(every) if coupling in couplings)]

    # --- parts ----------------------------------------------------------------------------------------------------

    def _part(self, joints: set[int], cuts: set[int]) -> TaskPart:
        """Return the linkage of some joints and cuts."""
        model, source, at = pin.Model(), self.mechanism.model, self._at
        body, virtual = 0, []
        for k, (joint, placement) in enumerate(self._virtual.joints()):
            virtual.append(f"{_VIRTUAL} {k + 1}")
            body = model.addJoint(body, joint, placement, virtual[-1])
        target = body, pin.SE3(np.eye(3), self._virtual.origin).inverse() * self._home
        model.addFrame(pin.Frame(_VIRTUAL, *target, pin.FrameType.BODY))
        fixed, index = self._carrier(self._end) if self._kind is LoopKind.RIGID else -1, dict[int, int]()

        def carried(body: int) -> tuple[int, pin.SE3]:
            """Return the part's joint that carries a body of the mechanism, and the body's placement on it."""
            carrier = self._carrier(body)
            if carrier == fixed:
                return target[0], target[1] * self._home.actInv(at[body])
            if carrier == self._root:
                return 0, at[body]
            return index[carrier], pin.SE3.Identity() if carrier == body else at[carrier].actInv(at[body])

        for j in sorted(joints):
            parent, placement = carried(int(source.parents[j]))
            index[j] = model.addJoint(parent, source.joints[j], placement * source.jointPlacements[j], source.names[j])
        loops = list[LoopConstraint]()

        def close(name: str, kind: LoopKind, *ends: tuple[int, pin.SE3]) -> None:
            first, second = f"{name} 1", f"{name} 2"
            for node, (joint, placement) in zip((first, second), ends, strict=True):
                model.addFrame(pin.Frame(node, joint, placement, pin.FrameType.BODY))
            loops.append(LoopConstraint(name, kind, first, second, pin.SE3.Identity(), pin.SE3.Identity()))

        for k in sorted(cuts):
            a, on_a, b, on_b = self.mechanism.structure.system.anchors[k]
            ends = [(joint, pose * end) for (joint, pose), end in ((carried(a), on_a), (carried(b), on_b))]
            close(self.mechanism.loops[k].name, self.mechanism.loops[k].kind, *ends)
        end = self._carrier(self._end)
        if end in joints:
            about = pin.SE3(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), self._axis).matrix(), np.zeros(3))
            frame = at[end].actInv(self._home)
            close(_VIRTUAL, self._kind, (target[0], target[1] * about), (index[end], frame * about))
        return self._solved(model, virtual, loops)

    def _solved(self, model: pin.Model, virtual: list[str], loops: list[LoopConstraint]) -> TaskPart:
        mechanism, q = self.mechanism, np.zeros(model.nq)
        names = [name for name in model.names if name not in ("universe", *virtual)]
        for name in names:
            q[model.joints[model.getJointId(name)].idx_q] = self.start[mechanism.q_index(name)]
        couplings = tuple(coupling for coupling in self.couplings if coupling.follower in names)
        systems = subsystems(ClosedLoops(model, loops, mechanism.length, couplings))
        ranks = tuple(closure.generic_rank(system, q[at])[0] for system, at in systems)
        part = Mechanism(
            name=mechanism.name, model=model, nodes=(_VIRTUAL,), joints=(*virtual, *names),
            actuated=tuple(virtual), loops=tuple(loops), length=mechanism.length, floating=False, q_home=q,
            cluster_ranks=ranks, gap_as_written=0.0, sensors={}, sensor_constraints=(),
            source=MechanismSource("", None, None, mechanism.name), couplings=couplings,
        )  # fmt: skip
        chosen = {*mechanism.actuated, *(name for coupling in mechanism.couplings for name in coupling.terms)}
        distinct = tuple(name for name in names if name in chosen or name not in self._in_loops)
        try:
            return TaskPart(part, tuple(names), distinct, ModesSolver(part, recognise_part, distinct, True))
        except FreeMotionError as error:
            raise ModesError(
                f"{mechanism.name}: with '{self.task.node}' at a pose its joints {', '.join(names)} still have "
                f"{error.dof} DoF: there is a curve of solutions, not a number of them. Constrain more of the pose, or "
                f"lock {error.dof} of its joints"
            ) from None
        except ModesError:
            if not couplings:
                raise
            listed = ", ".join(f"'{coupling.name}'" for coupling in couplings)
            raise ModesError(
                f"{mechanism.name}: with couplings between the joints that move '{self.task.node}', inverse solutions "
                f"are computed where one joint follows another by a ratio of 1 or -1, not for {listed}"
            ) from None

    # --- poses ----------------------------------------------------------------------------------------------------

    def virtual_pose(self, pose: pin.SE3, q: Array) -> VirtualPose:
        """Return the values of the virtual joints for the frame's pose in the world; a free base is where it is in q
        (nq,)."""
        data = self.mechanism.structure.system.data
        pin.forwardKinematics(self.mechanism.model, data, q)
        wanted = data.oMi[self._root].actInv(pose)
        if self.task.rotation < 3 and self._virtual.rotations == 0:  # the orientation follows
            wanted = pin.SE3(self._home.rotation, wanted.translation)
        values, made = self._virtual.coordinates(wanted * self._home.inverse())
        error = (made * self._home).actInv(wanted)
        return VirtualPose(
            values, float(np.linalg.norm(error.translation)), float(np.linalg.norm(pin.log3(error.rotation)))
        )


def _joined(cycles: list[set[int]]) -> list[set[int]]:
    """Return the unions of sets that share elements, directly or through others."""
    groups = list[set[int]]()
    for cycle in cycles:
        sharing = [group for group in groups if group & cycle]
        groups = [group for group in groups if not group & cycle] + [cycle.union(*sharing)]
    return groups
