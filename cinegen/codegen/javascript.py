"""Files in JavaScript: an ES module whose factory makes robots, and a program for node that tests it."""

from __future__ import annotations

from cinegen.codegen.cases import Cases
from cinegen.codegen.language import Language
from cinegen.codegen.program import IK_STATUSES, STATUSES, Program
from cinegen.codegen.text import filled, header, numbers, rendered, table, values_of
from raff2urdf.escape import javascript


def files(program: Program, cases: Cases) -> dict[str, str]:
    """Return the texts by the names of the files.

    All of a module is inside of one function: engines run the code several times slower where it reads variables of a
    module.
    """
    mechanism, heap = program.mechanism, program.translation.heap.values
    names = {
        "q": program.numbers_of_q(), "actuated": mechanism.actuated, "nodes": mechanism.nodes, "tasks": program.tasks,
        "statuses": STATUSES,
    }  # fmt: skip
    values = values_of(program) | {
        "names": javascript(names), "ik_statuses": javascript(IK_STATUSES),
        "actuated_in_q": numbers(program.actuated(), Language.JAVASCRIPT),
        "home_d": "\n".join(table(filled(heap["D"]), Language.JAVASCRIPT)),
        "home_i": "\n".join(table(filled(heap["I"]), Language.JAVASCRIPT)),
        "cases": javascript({name: values.tolist() for name, values in cases.items() if name != "reached"}),
    }  # fmt: skip
    for name, begin, size in program.places():
        values[f"view_{name}"], values[f"end_of_{name}"] = f"D.subarray({begin}, {begin + size})", begin + size
    test = values | {"header": "\n".join(header(program, "Test of the kinematics"))}
    parts = {each.value for each in program.functions}
    return {
        f"{program.name}.mjs": rendered("robot.mjs.in", values, parts),
        f"{program.name}_test.mjs": rendered("robot_test.mjs.in", test, parts),
    }
