"""A generated program: a mechanism, its translated kernels, and the functions that they offer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from cinegen.codegen.heap import HeapArray
from cinegen.codegen.inverse import TOLERANCE
from cinegen.codegen.kernels import RobotMemory
from cinegen.codegen.precision import CLOSURE_ERROR, POSITION_ERROR
from cinegen.codegen.translation import KernelTranslation
from cinegen.errors import CinegenError
from cinegen.jit.memory import memory_at
from cinegen.model import Mechanism

STATUSES = (
    "BAD_TARGET", "REFUSED", "AT_LIMIT", "SINGULAR", "OUT_OF_REACH", "FOLLOWING", "IDLE", "DETOUR", "BARRED",
)  # fmt: skip
"""Statuses of a tick, in the order of the kernels: see `cinegen.ik.Status`."""


IK_STATUSES = ("BAD_TARGET", "NOT_FOUND", "FOUND")
"""Results of inverse kinematics, in the order of the kernels."""


class GenerationError(CinegenError):
    """Code that can't be generated; the message names the reason."""


class Function(Enum):
    """Ability of the generated code."""

    FORWARD = "fk"
    """Poses of all nodes, with loops closed from values of the actuated joints on their branch."""
    CLOSE = "close"
    """Closing the loops near any configuration."""
    TICK = "tick"
    """A tick of the resolved-rate solver towards targets of tasks, within limits of position and velocity."""
    SIGMA = "sigma"
    """Singular values of the tasks."""
    IK = "ik"
    """Configurations in which the tasks are at their targets."""


FIELDS: dict[Function | None, tuple[str, ...]] = {
    None: ("q", "node_frame"),
    Function.FORWARD: ("goal",),
    Function.CLOSE: ("trial", "locked"),
    Function.TICK: ("trial", "record_errors"),
    Function.SIGMA: ("squares",),
    Function.IK: ("trial", "ik_tolerance", "ik_iterations"),
}
"""Arrays of the memory that the code's user reads or writes."""


@dataclass(frozen=True)
class Program:
    """Attributes:
    mechanism: mechanism.
    memory: from which its kernels were translated.
    translation: of them.
    name: of the files.
    source: origin of the mechanism, or "".
    functions: what it offers.
    tasks: nodes of the tasks.
    dt: period of a tick, s.
    most_iterations: of inverse kinematics.
    """

    mechanism: Mechanism
    memory: RobotMemory
    translation: KernelTranslation
    name: str
    source: str
    functions: tuple[Function, ...]
    tasks: tuple[str, ...]
    dt: float
    most_iterations: int = 0

    @property
    def tolerance(self) -> float:
        """Largest difference from Python that the test program accepts, m and rad."""
        if not self.translation.language.is_single:
            return 1e-9
        return POSITION_ERROR * max(self.mechanism.length, 1.0)

    @property
    def closure(self) -> float:
        """Largest residual of loops that the test program accepts, rad or characteristic lengths."""
        return CLOSURE_ERROR if self.translation.language.is_single else 1e-9

    @property
    def ik_tolerance(self) -> float:
        """Largest error of a target in the test program, m and rad."""
        return POSITION_ERROR * max(self.mechanism.length, 1.0) if self.translation.language.is_single else TOLERANCE

    def numbers_of_q(self) -> list[str]:
        """Return what each number of q is: see `names_of_q`."""
        return names_of_q(self.mechanism)

    def place(self, name: str) -> HeapArray:
        """Return where an array of the memory is."""
        return self.translation.heap.place(self.memory, name)

    def places(self) -> list[tuple[str, int, int]]:
        """Return the name, the first index and the size of each array that the code's user reads or writes."""
        names = dict.fromkeys(name for function in (None, *self.functions) for name in FIELDS[function])
        return [(name, self.place(name).begin, math.prod(self.place(name).shape)) for name in names]

    def actuated(self) -> list[int]:
        """Return the index in q of each actuated joint."""
        return [self.mechanism.q_index(name) for name in self.mechanism.actuated]

    def targets(self) -> list[int]:
        """Return the index of each task's target; none if no function has targets."""
        if Function.TICK not in self.functions and Function.IK not in self.functions:
            return []
        tasks = [memory_at(int(handle)) for handle in self.memory.task_handles]
        return [self.translation.heap.array(task, "own_target").begin for task in tasks]


def names_of_q(mechanism: Mechanism) -> list[str]:
    """Return what each number of q is: a joint's name, or a part of a ball joint's quaternion or of the base."""
    model, names = mechanism.model, [""] * mechanism.model.nq
    parts = {1: ("",), 4: (".x", ".y", ".z", ".w"), 7: (".x", ".y", ".z", ".qx", ".qy", ".qz", ".qw")}
    for index, joint in list(enumerate(model.joints))[1:]:
        name = "base" if joint.nq == 7 else model.names[index]
        names[joint.idx_q : joint.idx_q + joint.nq] = [name + part for part in parts[joint.nq]]
    return names
