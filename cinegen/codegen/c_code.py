"""Files in C99: a header, the code, and a program that tests it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from cinegen.codegen.cases import Cases
from cinegen.codegen.language import Language, function, literal
from cinegen.codegen.program import IK_STATUSES, STATUSES, Program
from cinegen.codegen.text import filled, header, listed, numbers, rendered, table, values_of
from raff2urdf.escape import identifiers

_SHARED = 255
"""Numbers at home that occur several times are counted up to this, which stands for the next of the others."""


def files(program: Program, cases: Cases) -> dict[str, str]:
    """Return the texts by the names of the files."""
    name, language, heap = program.name, program.translation.language, program.translation.heap.values
    prefixed = [f"{name}_NODE_{node} = {i}" for i, node in enumerate(identifiers(program.mechanism.nodes))]
    values = values_of(program) | {
        "real": language.real, "guard": f"{name.upper()}_H", "most_sigma": max(program.memory.lesser, 1),
        "actuated_in_q": numbers(program.actuated() or [0], language),
        "list_of_q": "\n".join(listed("q", program.numbers_of_q())),
        "list_of_actuated": "\n".join(listed("Actuated joints", program.mechanism.actuated)),
        "list_of_tasks": "\n".join(listed("Tasks", program.tasks)),
        "node_names": ", ".join(prefixed),
        "statuses": ", ".join(f"{name}_{status}" for status in STATUSES),
        "ik_statuses": ", ".join(f"{name}_IK_{status}" for status in IK_STATUSES),
        **_home(filled(heap["D"]), filled(heap["I"]), language),
    }  # fmt: skip
    test = values | {"header": "\n".join(header(program, "Test of the kinematics"))} | _test(program, cases)
    parts = {*(each.value for each in program.functions), *cases, "single" if language.is_single else "double"}
    parts |= {"cases"} if test["cases"] else set()
    return {
        f"{name}.h": rendered("robot.h.in", values, parts),
        f"{name}.c": rendered("robot.c.in", values, parts),
        f"{name}_test.c": rendered("robot_test.c.in", test, parts),
    }


def _home(reals: Sequence[float], integers: Sequence[float], language: Language) -> dict[str, Any]:
    """Return the tables of the numbers at home: many are 0 or 1, or occur several times."""
    words = [literal(value, language) for value in reals]
    shared = [word for word, count in Counter(words).most_common(_SHARED) if count > 1]
    codes = [shared.index(word) if word in shared else _SHARED for word in words]
    tables: dict[str, Sequence[float]] = {
        "shared": [reals[words.index(word)] for word in shared],
        "single": [value for value, code in zip(reals, codes, strict=True) if code == _SHARED],
        "home_d": codes,
        "home_i": integers,
    }
    small = "signed char" if all(-128 <= value < 128 for value in integers) else "int"
    texts = {name: "\n".join(table(numbers, language)) for name, numbers in tables.items()}
    return {"small": small, "most_shared": _SHARED, **texts}


def _test(program: Program, cases: Cases) -> dict[str, Any]:
    """Return what the test program takes besides."""
    name, language, nodes = program.name, program.translation.language, program.mechanism.nodes
    aims, fmax, lines = 12 * len(program.tasks), function("fmax", language), list[str]()
    for what, values in cases.items():
        if what not in (("solved", "ticked") if language.is_single else ("reached",)):
            kind = language.real if values.dtype.kind == "f" else "int"
            lines += [f"static const {kind} {what.upper()}[] = {{", *table(values.ravel().tolist(), language), "};"]

    def placed(wanted: str, first: int) -> str:
        """Return lines that compare the nodes of the tasks with frames, from one of the twelve numbers on: rounding
        moves joints further where parts hardly move, and a robot with more DoF than its task may be elsewhere."""
        places = [(f"{name}_node(&robot, {nodes.index(task)}) + {first}", k) for k, task in enumerate(program.tasks)]
        return "\n".join([
            f"    {name}_place(&robot);",
            *(f"    largest = {fmax}(largest, apart({at}, {wanted} + {aims} * i + {12 * k + first}, {12 - first}));"
              for at, k in places),
        ])  # fmt: skip

    return {
        "cases": "\n".join(lines), "fabs": function("abs", language), "fmax": fmax, "aims": aims,
        "frames": 12 * program.memory.nodes, "closure": literal(program.closure, language),
        "tolerance": literal(program.tolerance, language),
        "placed_at_aims": placed("AIMS", 9), "placed_as_reached": placed("REACHED", 0),
        **{f"{what}_cases": len(values) for what, values in cases.items()},
    }  # fmt: skip
