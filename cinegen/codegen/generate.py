"""`generate`: the kinematics of a mechanism as source code without dependencies."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

from cinegen.codegen import c_code, inverse_kernels, javascript, kernels
from cinegen.codegen.cases import recorded
from cinegen.codegen.inverse import InverseKinematics, most_iterations
from cinegen.codegen.language import Language, identifier, name_of
from cinegen.codegen.program import FIELDS, Function, GenerationError, Program
from cinegen.codegen.robot import robot_memory
from cinegen.codegen.translation import translated
from cinegen.ik import Solver
from cinegen.model import Mechanism

_FREE = ("task_rank", "goal_residual")
_STRUCTURE = (
    "joint_kind", "joint_parent", "joint_q", "joint_dof", "joint_axis", "scale", "q_index", "loop_kind", "loop_row",
    "loop_cut", "step_dof", "step_size", "dof", "row", "idle_dof", "actuated_dof", "node_joint", "row_axis",
    "row_weight",
)  # fmt: skip
"""Arrays that describe a mechanism and its tasks: no kernel writes them."""
_DT = 1.0 / 240.0

_KERNELS: dict[Function, tuple[Any, ...]] = {
    Function.FORWARD: (kernels.forward,),
    Function.CLOSE: (kernels.close,),
    Function.TICK: (kernels.step, kernels.set_q),
    Function.SIGMA: (kernels.find_sigma,),
    Function.IK: (inverse_kernels.find,),
}


def generate(
    mechanism: Mechanism,
    language: Language,
    *,
    tasks: Sequence[str] = (),
    functions: Iterable[Function] = tuple(Function),
    dt: float = _DT,
    name: str = "",
    source: str = "",
) -> dict[str, str]:
    """Return source code of a mechanism's kinematics, and a program that tests it with cases that Python has computed.

    It is translated from the kernels that cinegen runs, for this mechanism: sizes and parameters are constants, and
    what it does not need is left out. Nothing is allocated.

    Args:
        mechanism: mechanism, at home at first.
        language: language of the code.
        tasks: nodes that follow targets, one task each, of its whole pose: "NODE", or of its position only:
            "NODE:position"; the mechanism's end unless given.
        functions: what the code can do; poses of nodes at q in any case.
        dt: period of a tick, s.
        name: of the files and the prefix of C's names; the mechanism's unless given.
        source: what the header names as the origin, such as a file.

    Returns:
        texts by file names.

    Raises:
        GenerationError: a name is no identifier or begins one of a kernel, a task is not written as above, or no joint
            is actuated.
        CinegenError: dt is not positive, a node is unknown, there are more than six tasks, or the mechanism has joints
            that the kernels don't know.
    """
    name = identifier(name) if name else name_of(mechanism.name)
    if not re.fullmatch(r"[A-Za-z_]\w*", name):
        raise GenerationError(f"'{name}' is no name in C and JavaScript: give another one")
    if not mechanism.actuated:
        named = "; --actuated JOINTS (in Python load(..., actuated=[...])) names some" if mechanism.mobility else ""
        raise GenerationError(f"{mechanism.name} has no actuated joints, which generated code moves{named}")
    solver = Solver(mechanism, dt)
    for task in tasks or (mechanism.end,):
        node, _, what = task.partition(":")
        if what not in ("", "pose", "position"):
            raise GenerationError(f"task '{task}': write NODE or NODE:position")
        solver.add_task(node, rotation=0 if what == "position" else 3)
    memory, chosen = robot_memory(mechanism, solver.frame_tasks, dt), list(functions)
    inverse = InverseKinematics(mechanism, solver.frame_tasks) if Function.IK in chosen else None
    if inverse is not None:
        inverse.set_up(memory)
    entries = [kernels.place, *(kernel for function in chosen for kernel in _KERNELS[function])]
    fields = [name for function in (None, *chosen) for name in FIELDS[function]]
    translation = translated(language, memory, entries, fields, _FREE, _STRUCTURE)
    if language.is_c and any(function.name.startswith(f"{name}_") for function in translation.functions):
        raise GenerationError(f"'{name}' begins names of the kernels in C: give another one (--name, in Python name=)")
    nodes = tuple(task.node for task in solver.frame_tasks)
    program = Program(mechanism, memory, translation, name, source, tuple(chosen), nodes, dt, most_iterations(memory))
    cases = recorded(mechanism, solver, chosen, inverse)
    return c_code.files(program, cases) if language.is_c else javascript.files(program, cases)
