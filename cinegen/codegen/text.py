"""Texts of both languages: templates of files, the header, and tables of numbers."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence, Set
from pathlib import Path
from typing import Any, TypeAlias

from cinegen.codegen.language import Language, literal
from cinegen.codegen.precision import CLOSURE_ERROR, POSITION_ERROR
from cinegen.codegen.program import Program
from raff2urdf.errors import counted
from raff2urdf.escape import block_comment
from raff2urdf.files import GENERATED
from raff2urdf.version import __version__

Values: TypeAlias = Mapping[str, Any]
"""Values of a template, by name."""

_WIDTH = 110


def header(program: Program, what: str) -> list[str]:
    """Return the comment at the top of a file."""
    mechanism = program.mechanism
    origin = f" from {program.source}" if program.source else ""
    text = (
        f"{what} of {mechanism.name}{origin}: {counted(len(mechanism.joints), 'joint')} "
        f"({len(mechanism.actuated)} actuated), {counted(len(mechanism.loops), 'loop')}, mobility {mechanism.mobility}."
        " These are the kernels that cinegen itself runs, translated for this mechanism: change its file and generate "
        "again, instead of changing this one. Units are m, rad and s. The kernels are under cinegen's MIT licence; the "
        "numbers are the mechanism's."
    )
    if program.translation.language.is_single:
        length = mechanism.length
        text += (
            f" Numbers are floats. Where no singularity is near, loops are closed to {CLOSURE_ERROR:g} rad or "
            f"characteristic lengths ({1000.0 * CLOSURE_ERROR * length:.2g} mm), and frames are those of double "
            f"precision to {POSITION_ERROR:g} rad and {1000.0 * POSITION_ERROR * length:.2g} mm."
        )
    lines = textwrap.wrap(block_comment(text), _WIDTH)
    return [f"/* {GENERATED} {__version__}", *(f" * {line}" for line in lines), " */"]


def listed(what: str, names: Iterable[str]) -> list[str]:
    """Return the lines of a comment that lists names."""
    text = block_comment(f"{what}: {', '.join(names)}")
    return textwrap.wrap(f"/* {text} */", _WIDTH, subsequent_indent=" * ", break_on_hyphens=False)


def numbers(values: Iterable[float], language: Language) -> str:
    """Return numbers as they are read again, with commas."""
    return ", ".join(literal(value, language) for value in values)


def table(values: Sequence[float], language: Language) -> list[str]:
    """Return the lines of a table of numbers."""
    return textwrap.wrap(numbers(values, language), _WIDTH, initial_indent="  ", subsequent_indent="  ") or ["  0"]


def filled(values: Sequence[float]) -> list[float]:
    """Return numbers up to the last that is not 0."""
    end = len(values)
    while end > 1 and values[end - 1] == 0 and math.copysign(1.0, values[end - 1]) > 0:
        end -= 1
    return list(values[:end])


def values_of(program: Program) -> dict[str, Any]:
    """Return what templates of both languages take."""
    language, heap, memory = program.translation.language, program.translation.heap.values, program.memory
    functions = [line for each in program.translation.functions for line in ["", *each.lines]]  # callees first
    return {
        "header": "\n".join(header(program, "Kinematics")), "name": program.name, "functions": "\n".join(functions),
        "nq": memory.nq, "nv": memory.n, "actuated": memory.actuated, "nodes": memory.nodes, "tasks": memory.tasks,
        "size_d": len(heap["D"]), "size_i": max(len(heap["I"]), 1), "most_iterations": program.most_iterations,
        "dt": literal(program.dt, language), "ik_tolerance": literal(program.ik_tolerance, language),
        "targets": numbers(program.targets(), language),
        **{f"at_{name}": begin for name, begin, _ in program.places()},
    }  # fmt: skip


def rendered(template: str, values: Values, parts: Set[str]) -> str:
    """Return the text of a file.

    Args:
        template: name of a file in `templates/`. `@name@` stands for a value; lines between `@if a b` and `@end` are
            for programs that have one of the parts a and b.
        values: by name.
        parts: functions of the program, and what it is tested with.
    """
    lines, kept = list[str](), [True]
    for line in (Path(__file__).with_name("templates") / template).read_text().splitlines():
        if line.startswith("@if "):
            kept.append(not parts.isdisjoint(line.split()[1:]))
        elif line == "@end":
            kept.pop()
        elif all(kept):
            lines.append(re.sub(r"@(\w+)@", lambda name: str(values[name[1]]), line))
    return "\n".join(lines) + "\n"
