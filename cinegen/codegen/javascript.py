"""Files in JavaScript: an ES module whose factory makes robots, and a program for node that tests it."""

from __future__ import annotations

import numpy as np

from cinegen.codegen.cases import Cases
from cinegen.codegen.inverse import TOLERANCE
from cinegen.codegen.language import Language
from cinegen.codegen.program import IK_STATUSES, STATUSES, Function, Program
from cinegen.codegen.text import filled, functions, header, numbers, table
from raff2urdf.escape import javascript

_JS = Language.JAVASCRIPT


def files(program: Program, cases: Cases) -> dict[str, str]:
    """Return the texts by the names of the files."""
    return {
        f"{program.name}.mjs": "\n".join(module(program)) + "\n",
        f"{program.name}_test.mjs": "\n".join(_test(program, cases)) + "\n",
    }


def module(program: Program) -> list[str]:
    """Return the lines of the module."""
    mechanism, memory = program.mechanism, program.memory
    names = {
        "q": program.numbers_of_q(), "actuated": mechanism.actuated, "nodes": mechanism.nodes, "tasks": program.tasks,
        "statuses": STATUSES,
    }  # fmt: skip
    lines = [
        *header(program, "Kinematics"),
        "",
        f"export const names = {javascript(names)};",
        f"export const dt = {program.dt!r}; // s",
        "",
        "/** Return a robot at home. */",
        "export default function create() {",
        *translated_functions(program),
        "",
    ]

    def view(name: str) -> str:
        place = program.place(name)
        return f"D.subarray({place.begin}, {place.begin + int(np.prod(place.shape))})"

    lines += [
        "const robot = {",
        "  /** The configuration, with closed loops: read it only. */",
        f"  q: {view('q')},",
        "  /** Frames of all nodes, as `place` computes them: twelve numbers each, three axes, then the origin, m. */",
        f"  frames: {view('node_frame')},",
        "  /** Move to the home configuration. */",
        "  init() { D.fill(0.0); D.set(HOME_D); I.fill(0); I.set(HOME_I); },",
        "  /** Return the values of the actuated joints at q. */",
        f"  actuated() {{ return [{numbers(program.actuated(), _JS)}].map((k) => robot.q[k]); }},",
        "  /** Compute the frames of all nodes at q. */",
        "  place() { kernels_place(); return robot.frames; },",
    ]
    if Function.FORWARD in program.functions:
        lines += [
            "  /** Move the actuated joints along a straight line to their values, loops closed on their branch.",
            "   * Return false, and move nothing, if they can't get there. */",
            f"  forward(actuated) {{ D.set(actuated, {program.place('goal').begin}); return kernels_forward(); }},",
        ]
    if Function.CLOSE in program.functions:
        locked, trial = program.place("locked").begin, program.place("trial").begin
        lines += [
            "  /** Close the loops of any configuration, in place; locked joints (indices of velocities) stay. Return",
            "   * the largest residual that is left, in rad or characteristic lengths. */",
            "  close(q, locked = []) {",
            f"    D.set(q, {trial});",
            f"    for (const k of locked) D[{locked} + k] = 1.0;",
            "    const gap = kernels_close();",
            f"    D.fill(0.0, {locked}, {locked + memory.n});",
            f"    for (let k = 0; k < {memory.nq}; k++) q[k] = D[{trial} + k];",
            "    return gap;",
            "  },",
        ]
    if program.targets():
        lines += [
            "  /** Targets of the tasks in the world, to be written: three axes, then the origin. */",
            f"  targets: [{numbers(program.targets(), _JS)}].map((begin) => D.subarray(begin, begin + 12)),",
            "  /** Move to a closed configuration at once, at rest. */",
            f"  set(q) {{ D.set(q, {program.place('trial').begin}); kernels_set_q(); }},",
        ]
    if Function.IK in program.functions:
        lines += [
            "  /** Move at once to a configuration, loops closed and joints within limits, in which the tasks are at",
            "   * their targets, to a tolerance, m and rad: near q, or found from other starts. Return",
            '   * "FOUND"; or "NOT_FOUND" or "BAD_TARGET", and move nothing. */',
            f"  ik(tolerance = {TOLERANCE!r}) {{",
            f"    D[{program.place('ik_tolerance').begin}] = tolerance;",
            f"    return {javascript(IK_STATUSES)}[inverse_kernels_find()];",
            "  },",
            f"  /** Iterations of the last call of `ik`, {program.most_iterations} at most. */",
            f"  ikIterations() {{ return I[{program.place('ik_iterations').begin}]; }},",
        ]
    if Function.TICK in program.functions:
        lines += [
            "  /** What the last tick left of the tasks' errors: of each its distance and angle. */",
            f"  errors: {view('record_errors')},",
            "  /** Move q towards the targets for `dt` seconds, within limits of position and velocity; return the",
            "   * status. */",
            "  tick() { return names.statuses[kernels_step()]; },",
        ]
    if Function.SIGMA in program.functions:
        begin = program.place("squares").begin
        lines += [
            "  /** Return the singular values of the tasks at q, dimensionless, the largest first. */",
            f"  sigma() {{ const count = kernels_find_sigma(); return D.slice({begin}, {begin} + count); }},",
        ]
    return [*lines, "};", "robot.init();", "return robot;", "}"]


def translated_functions(program: Program) -> list[str]:
    """Return the lines of the tables and functions, for the inside of one function: engines run the code several times
    slower where it reads variables of a module."""
    values = program.translation.heap.values
    return [
        f"const D = new Float64Array({len(values['D'])}), I = new Int32Array({max(len(values['I']), 1)});",
        "const HOME_D = [", *table(filled(values["D"]), _JS), "];",
        "const HOME_I = [", *table(filled(values["I"]), _JS), "];",
        "const least = (a, b) => b < a ? b : a;",
        "const most = (a, b) => b > a ? b : a;",
        *functions(program),
    ]  # fmt: skip


def _test(program: Program, cases: Cases) -> list[str]:
    data = {name: values.tolist() for name, values in cases.items() if name != "reached"}
    return [
        *header(program, "Test of the kinematics"),
        f'import create, {{ names }} from "./{program.name}.mjs";',
        "",
        f"const cases = {javascript(data)};",
        "const robot = create();",
        "let wrong = 0, error = 0.0, largest = 0.0;",
        "function compare(found, wanted) {",
        "  wanted.forEach((value, k) => {",
        "    const apart = Math.abs(found[k] - value);",
        "    if (!(apart <= largest)) largest = apart;",
        "  });",
        "}",
        "function end(what) {",
        "  console.log(`${what} ${largest.toPrecision(3)}`);",
        "  error = Math.max(error, largest);",
        "  largest = 0.0;",
        "  robot.init();",
        "}",
        "if (cases.forward) {",
        "  cases.actuated.forEach((values, i) => {",
        "    if (!robot.forward(values)) wrong += 1;",
        "    compare(robot.q, cases.forward[i]);",
        "    compare(robot.place(), cases.frames[i]);",
        "  });",
        '  end("forward");',
        "}",
        "if (cases.open) {",
        "  cases.open.forEach((given, i) => {",
        "    const q = Float64Array.from(given);",
        "    if (!(robot.close(q) <= 1e-9)) wrong += 1;",
        "    compare(q, cases.closed[i]);",
        "  });",
        '  end("close");',
        "}",
        "if (cases.ticked) {",
        "  cases.targets.forEach((targets, i) => {",
        "    targets.forEach((target, task) => robot.targets[task].set(target));",
        "    if (robot.tick() !== names.statuses[cases.statuses[i]]) wrong += 1;",
        "    compare(robot.q, cases.ticked[i]);",
        "  });",
        '  end("tick");',
        "}",
        "if (cases.aims) {",
        "  cases.aims.forEach((targets, i) => {",
        "    targets.forEach((target, task) => robot.targets[task].set(target));",
        f'    if ((robot.ik({TOLERANCE!r}) === "FOUND") !== (cases.found[i][0] === 1)) wrong += 1;',
        "    if (cases.found[i][0] === 1 && robot.ikIterations() !== cases.found[i][1]) wrong += 1;",
        "    compare(robot.q, cases.solved[i]);",
        "  });",
        '  end("ik");',
        "}",
        "console.log(`${wrong} wrong results, largest difference ${error.toPrecision(3)}`);",
        "process.exit(wrong > 0 || !(error <= 1e-9) ? 1 : 0);",
    ]
