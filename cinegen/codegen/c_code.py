"""Files in C99: a header, the code, and a program that tests it."""

from __future__ import annotations

from collections import Counter

from cinegen.codegen.cases import Cases
from cinegen.codegen.language import Language, function, literal
from cinegen.codegen.program import FIELDS, IK_STATUSES, STATUSES, Function, Program
from cinegen.codegen.text import filled, functions, header, listed, numbers, table
from raff2urdf.escape import identifiers

_SHARED = 255
"""Numbers at home that occur several times are counted up to this, which stands for the next of the others."""


def _home(numbers_: list[float], integers: list[float], language: Language) -> list[str]:
    """Return the tables of the numbers at home: many are 0 or 1, or occur several times."""
    words = [literal(value, language) for value in numbers_]
    shared = [word for word, count in Counter(words).most_common(_SHARED) if count > 1]
    codes = [shared.index(word) if word in shared else _SHARED for word in words]
    single = [value for value, code in zip(numbers_, codes, strict=True) if code == _SHARED]
    small = "signed char" if all(-128 <= value < 128 for value in integers) else "int"
    real = language.real
    return [
        f"static const {real} SHARED[] = {{", *table([numbers_[words.index(word)] for word in shared], language), "};",
        f"static const {real} SINGLE[] = {{", *table(single, language), "};",
        "static const unsigned char HOME_D[] = {", *table(codes, language), "};",
        f"static const {small} HOME_I[] = {{", *table(integers, language), "};",
    ]  # fmt: skip


def _extremes(real: str) -> list[str]:
    return [
        f"static inline {real} least({real} a, {real} b) {{ return b < a ? b : a; }}",
        f"static inline {real} most({real} a, {real} b) {{ return b > a ? b : a; }}",
        "static inline int least_int(int a, int b) { return b < a ? b : a; }",
        "static inline int most_int(int a, int b) { return b > a ? b : a; }",
    ]


def files(program: Program, cases: Cases) -> dict[str, str]:
    """Return the texts by the names of the files."""
    return {
        f"{program.name}.h": "\n".join(_header(program)) + "\n",
        f"{program.name}.c": "\n".join(_code(program)) + "\n",
        f"{program.name}_test.c": "\n".join(_test(program, cases)) + "\n",
    }


def _declarations(program: Program) -> list[tuple[tuple[Function, ...], str, str]]:
    """Return of each public function for what it is offered (always if that is empty), its comment and declaration."""
    name, real = program.name, program.translation.language.real
    robot = f"{name}_robot *robot"
    return [
        ((), "Move to the home configuration.", f"void {name}_init({robot})"),
        ((), f"The configuration: {name}_NQ numbers, with closed loops.", f"const {real} *{name}_q(const {robot})"),
        (
            (),
            f"Write the values of the actuated joints at q: {name}_ACTUATED numbers.",
            f"void {name}_actuated(const {robot}, {real} *values)",
        ),
        ((), "Compute the frames of all nodes at q.", f"void {name}_place({robot})"),
        (
            (),
            "Frame of a node in the world, computed by the last call of place: its three axes, then its origin.",
            f"const {real} *{name}_node(const {robot}, int node)",
        ),
        (
            (Function.FORWARD,),
            "Move the actuated joints along a straight line to their values, loops closed on their branch. "
            "False, and nothing moves, if they can't get there.",
            f"bool {name}_forward({robot}, const {real} *actuated)",
        ),
        (
            (Function.CLOSE,),
            f"Close the loops of any configuration ({name}_NQ numbers); locked joints ({name}_NV, or NULL) stay. "
            "Return the largest residual that is left, in rad or characteristic lengths.",
            f"{real} {name}_close({robot}, {real} *q, const bool *locked)",
        ),
        (
            (Function.TICK, Function.IK),
            "Move to a closed configuration at once, at rest.",
            f"void {name}_set_q({robot}, const {real} *q)",
        ),
        (
            (Function.TICK, Function.IK),
            "Target of a task in the world, to be written: three axes, then the origin.",
            f"{real} *{name}_target({robot}, int task)",
        ),
        (
            (Function.TICK,),
            f"Move q towards the targets for {name}_DT seconds, within limits of position and velocity.",
            f"{name}_status {name}_tick({robot})",
        ),
        (
            (Function.TICK,),
            "What the last tick left of a task's error: distance and angle.",
            f"const {real} *{name}_error(const {robot}, int task)",
        ),
        (
            (Function.IK,),
            "Move at once to a configuration, loops closed and joints within limits, in which the tasks are at their "
            "targets, to a tolerance, m and rad: near q, or found from other starts. If none is found, nothing moves.",
            f"{name}_ik_status {name}_ik({robot}, {real} tolerance)",
        ),
        (
            (Function.IK,),
            f"Iterations of the last call of ik, {name}_IK_ITERATIONS at most.",
            f"int {name}_ik_iterations(const {robot})",
        ),
        (
            (Function.SIGMA,),
            f"Write the singular values of the tasks at q ({name}_SIGMA at most), dimensionless, the largest first; "
            "return their number.",
            f"int {name}_sigma({robot}, {real} *sigma)",
        ),
    ]


def _is_offered(program: Program, functions: tuple[Function, ...]) -> bool:
    return not functions or any(one in program.functions for one in functions)


def _header(program: Program) -> list[str]:
    name, values, memory = program.name, program.translation.heap.values, program.memory
    language, real = program.translation.language, program.translation.language.real
    guard, nodes = f"{name.upper()}_H", identifiers(program.mechanism.nodes)
    lines = [*header(program, "Kinematics"), f"#ifndef {guard}", f"#define {guard}", "", "#include <stdbool.h>", ""]
    lines += [
        f"#define {name}_NQ {memory.nq}",
        f"#define {name}_NV {memory.n}",
        f"#define {name}_ACTUATED {memory.actuated}",
        f"#define {name}_NODES {memory.nodes}",
        f"#define {name}_TASKS {memory.tasks}",
        f"#define {name}_SIGMA {max(memory.lesser, 1)}",
        f"#define {name}_DT {literal(program.dt, language)}",
        "",
        *listed("q", program.numbers_of_q()),
        *listed("Actuated joints", program.mechanism.actuated),
        f"enum {{ {', '.join(f'{name}_NODE_{node} = {i}' for i, node in enumerate(nodes))} }};",
        *listed("Tasks", program.tasks),
        "",
        f"typedef enum {{ {', '.join(f'{name}_{status}' for status in STATUSES)} }} {name}_status;",
        "",
        *_inverse_types(program),
        "/* A robot: all that changes. No two threads may use one at a time. */",
        f"typedef struct {{ {real} D[{len(values['D'])}]; int I[{max(len(values['I']), 1)}]; }} {name}_robot;",
        "",
    ]
    for wanted, comment, declaration in _declarations(program):
        if _is_offered(program, wanted):
            lines += [f"/* {comment} */", f"{declaration};", ""]
    return [*lines, "#endif"]


def _inverse_types(program: Program) -> list[str]:
    if Function.IK not in program.functions:
        return []
    name = program.name
    statuses = ", ".join(f"{name}_IK_{status}" for status in IK_STATUSES)
    return [
        f"#define {name}_IK_ITERATIONS {program.most_iterations}",
        f"typedef enum {{ {statuses} }} {name}_ik_status;",
        "",
    ]


def _code(program: Program) -> list[str]:
    name, values, memory = program.name, program.translation.heap.values, program.memory
    language, real = program.translation.language, program.translation.language.real
    given = [one for wanted, _, one in _declarations(program) if _is_offered(program, wanted)]
    offered = {one.partition("(")[0].split()[-1].lstrip("*").removeprefix(f"{name}_"): one for one in given}
    used = [field for one in (None, *program.functions) for field in FIELDS[one]]
    at = {field: program.place(field).begin if field in used else 0 for fields in FIELDS.values() for field in fields}
    heap = "robot->D, robot->I"
    bodies = {
        "init": [
            "int i, next = 0;",
            "memset(robot, 0, sizeof *robot);",
            "for (i = 0; i < (int) sizeof HOME_D; i++) {",
            f"  robot->D[i] = HOME_D[i] < {_SHARED} ? SHARED[HOME_D[i]] : SINGLE[next++];",
            "}",
            "for (i = 0; i < (int) (sizeof HOME_I / sizeof HOME_I[0]); i++) {",
            "  robot->I[i] = HOME_I[i];",
            "}",
        ],
        "q": [f"return robot->D + {at['q']};"],
        "actuated": [
            f"static const int index[] = {{ {numbers(program.actuated() or [0], language)} }};",
            "int i;",
            f"for (i = 0; i < {memory.actuated}; i++) {{",
            f"  values[i] = robot->D[{at['q']} + index[i]];",
            "}",
        ],
        "place": [f"kernels_place({heap});"],
        "node": [f"return robot->D + {at['node_frame']} + 12 * node;"],
        "forward": [
            f"memcpy(robot->D + {at['goal']}, actuated, {memory.actuated} * sizeof({real}));",
            f"return kernels_forward({heap});",
        ],
        "close": [
            f"{real} gap;",
            "int k;",
            f"memcpy(robot->D + {at['trial']}, q, {memory.nq} * sizeof({real}));",
            f"for (k = 0; k < {memory.n}; k++) {{",
            f"  robot->D[{at['locked']} + k] = locked && locked[k] ? 1 : 0;",
            "}",
            f"gap = kernels_close({heap});",
            f"memcpy(q, robot->D + {at['trial']}, {memory.nq} * sizeof({real}));",
            f"memset(robot->D + {at['locked']}, 0, {memory.n} * sizeof({real}));",
            "return gap;",
        ],
        "set_q": [f"memcpy(robot->D + {at['trial']}, q, {memory.nq} * sizeof({real}));", f"kernels_set_q({heap});"],
        "target": [
            f"static const int begin[] = {{ {numbers(program.targets(), language)} }};",
            "return robot->D + begin[task];",
        ],
        "tick": [f"return ({name}_status) kernels_step({heap});"],
        "error": [f"return robot->D + {at['record_errors']} + 2 * task;"],
        "ik": [
            f"robot->D[{at['ik_tolerance']}] = tolerance;",
            f"return ({name}_ik_status) inverse_kernels_find({heap});",
        ],
        "ik_iterations": [f"return robot->I[{at['ik_iterations']}];"],
        "sigma": [
            f"const int count = kernels_find_sigma({heap});",
            f"memcpy(sigma, robot->D + {at['squares']}, (unsigned) count * sizeof({real}));",
            "return count;",
        ],
    }
    lines = [
        *header(program, "Kinematics"), f'#include "{name}.h"', "", "#include <math.h>", "#include <string.h>", "",
        *_extremes(real), "",
        *_home(filled(values["D"]), filled(values["I"]), language),
        *functions(program),
    ]  # fmt: skip
    for one, declaration in offered.items():
        lines += ["", f"{declaration} {{", *(f"  {line}" for line in bodies[one]), "}"]
    return lines


def _test(program: Program, cases: Cases) -> list[str]:
    name, language, real = program.name, program.translation.language, program.translation.language.real
    fabs, fmax, is_single = function("abs", language), function("fmax", language), language.is_single
    nq, nodes, tasks, aims = program.memory.nq, program.mechanism.nodes, program.tasks, 12 * len(program.tasks)
    lines = [*header(program, "Test of the kinematics"), f'#include "{name}.h"', ""]
    lines += ["#include <math.h>", "#include <stdio.h>", "#include <string.h>", ""]
    for what, values in cases.items():
        if what not in (("solved", "ticked") if is_single else ("reached",)):
            kind = real if values.dtype.kind == "f" else "int"
            lines += [f"static const {kind} {what.upper()}[] = {{", *table(values.ravel().tolist(), language), "};"]
    lines += [
        "",
        "/* Largest difference of two lists. */",
        f"static {real} apart(const {real} *a, const {real} *b, int n) {{",
        f"  {real} largest = 0;",
        "  for (int k = 0; k < n; k++) {",
        f"    largest = !({fabs}(a[k] - b[k]) <= largest) ? {fabs}(a[k] - b[k]) : largest;",
        "  }",
        "  return largest;",
        "}",
        "",
        "int main(void) {",
        f"  static {name}_robot robot;",
        f"  {real} largest, error = 0;",
        "  int i, wrong = 0;",
    ]

    def compared(found: str, wanted: str, size: int, begin: int = 0, count: int = 0) -> str:
        return f"largest = {fmax}(largest, apart({found}, {wanted} + {size} * i + {begin}, {count or size}));"

    def aimed(targets: str) -> list[str]:
        return [
            f"for (int task = 0; task < {len(tasks)}; task++) {{",
            f"  memcpy({name}_target(&robot, task), {targets} + {aims} * i + 12 * task, 12 * sizeof({real}));",
            "}",
        ]

    def placed(wanted: str, first: int) -> list[str]:
        """Return lines that compare the nodes of the tasks with frames, from one of the twelve numbers on: rounding
        moves joints further where parts hardly move, and a robot with more DoF than its task may be elsewhere."""
        return [f"{name}_place(&robot);"] + [
            compared(f"{name}_node(&robot, {nodes.index(task)}) + {first}", wanted, aims, 12 * k + first, 12 - first)
            for k, task in enumerate(tasks)
        ]

    at_q, tolerance = f"{name}_q(&robot)", literal(program.ik_tolerance, language)
    solved = ["if (FOUND[2 * i] == 1) {", *placed("AIMS", 9), "}"] if is_single else [compared(at_q, "SOLVED", nq)]
    for what, count, body in (
        ("forward", "forward", [
            f"wrong += !{name}_forward(&robot, ACTUATED + {program.memory.actuated} * i);",
            f"{name}_place(&robot);",
            compared(at_q, "FORWARD", nq),
            compared(f"{name}_node(&robot, 0)", "FRAMES", 12 * program.memory.nodes),
        ]),
        ("close", "closed", [
            f"{real} q[{name}_NQ];",
            f"memcpy(q, OPEN + {nq} * i, sizeof q);",
            f"wrong += !({name}_close(&robot, q, NULL) <= {literal(program.closure, language)});",
            compared("q", "CLOSED", nq),
        ]),
        ("tick", "ticked", [
            *aimed("TARGETS"),
            f"wrong += (int) {name}_tick(&robot) != STATUSES[i];",
            *(placed("REACHED", 0) if is_single else [compared(at_q, "TICKED", nq)]),
        ]),
        ("ik", "found", [
            *aimed("AIMS"),
            f"wrong += ({name}_ik(&robot, {tolerance}) == {name}_IK_FOUND) != (FOUND[2 * i] == 1);",
            # rounding may take another iteration
            f"wrong += {int(not is_single)} && FOUND[2 * i] == 1 && {name}_ik_iterations(&robot) != FOUND[2 * i + 1];",
            *solved,
        ]),
    ):  # fmt: skip
        if count in cases:
            lines += [
                f"  {name}_init(&robot);",
                "  largest = 0;",
                f"  for (i = 0; i < {len(cases[count])}; i++) {{",
                *(f"    {line}" for line in body),
                "  }",
                f'  printf("{what} %.3g\\n", (double) largest);',
                f"  error = {fmax}(error, largest);",
            ]
    return [
        *lines,
        '  printf("%d wrong results, largest difference %.3g\\n", wrong, (double) error);',
        f"  return wrong > 0 || !(error <= {literal(program.tolerance, language)});",
        "}",
    ]
