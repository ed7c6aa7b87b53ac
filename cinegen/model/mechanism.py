"""`Mechanism`: any robot, serial, tree or closed, as a Pinocchio model with its loops. It never changes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.html import table
from cinegen.loops.clusters import subsystems
from cinegen.loops.held_loops import HeldLoops
from cinegen.loops.screws import LoopScrews
from cinegen.model.limits import Limits
from cinegen.model.loop_kinematics import LoopKinematics
from cinegen.model.masses import massless, unphysical
from cinegen.model.mechanism_model import MechanismSource
from cinegen.model.shapes import Shapes, collision_shapes, geometry_model, lost_meshes, visual_shapes
from raff2urdf import closure
from raff2urdf.errors import counted

_Result = TypeVar("_Result")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Mechanism(LoopKinematics):
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
        joints += f", {counted(len(self.balls), 'ball joint')}" if self.balls else ""
        coupled = len(self.couplings)
        loops += f", {counted(coupled, 'coupling')}" if coupled else ""
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
        made.structure.__dict__["screws"] = LoopScrews(
            made.structure.own_system(), made.q_home, made.structure.passive_columns, threes
        )
        return made

    @property
    def mobility(self) -> int:
        """Degrees of freedom that loops and couplings leave, counted on random closed configurations."""
        return int(self.model.nv) - len(self.structure.held_columns) - self.loop_rank

    @property
    def gravity(self) -> Array:
        """(3,) acceleration of gravity that the file states, m/s^2, in the world; (0, 0, -9.81) unless it does."""
        return np.array(self.model.gravity.linear)

    @cached_property
    def limits(self) -> Limits:
        """Limits of position, velocity and effort, by joint name and as arrays; rad, m, s, N."""
        return Limits(self.model, self.joints)

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
        q = np.array(q, dtype=float)
        system = HeldLoops(self.model, self.loops, self.length, self.couplings, columns, q)
        ranks = [closure.generic_rank(part, q[at])[0] if part.model.nv else 0 for part, at in subsystems(system)]
        return replace(self, held=held, held_q=q, cluster_ranks=tuple(ranks))

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


def _held_copy(source: MechanismSource, held: tuple[str, ...], q: Array) -> Mechanism:
    """Return what `Mechanism.with_held` does, in another process."""
    from cinegen.model.build import build

    return build(*source).with_held(held, q)
