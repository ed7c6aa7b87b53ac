"""Texts of both languages: the header, tables of numbers, and the translated functions."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence

from cinegen.codegen.language import Language, literal
from cinegen.codegen.precision import CLOSURE_ERROR, POSITION_ERROR
from cinegen.codegen.program import Program
from raff2urdf.escape import block_comment
from raff2urdf.files import GENERATED
from raff2urdf.version import __version__

_WIDTH = 110


def header(program: Program, what: str) -> list[str]:
    """Return the comment at the top of a file."""
    mechanism = program.mechanism
    origin = f" from {program.source}" if program.source else ""
    text = (
        f"{what} of {mechanism.name}{origin}: {len(mechanism.joints)} joints ({len(mechanism.actuated)} actuated), "
        f"{len(mechanism.loops)} loops, mobility {mechanism.mobility}. These are the kernels that cinegen itself runs, "
        "translated for this mechanism: change its file and generate again, instead of changing this one. Units are m, "
        "rad and s. The kernels are under cinegen's MIT licence; the numbers are the mechanism's."
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


def functions(program: Program) -> list[str]:
    """Return the translated functions, callees first."""
    return [line for one in program.translation.functions for line in ["", *one.lines]]
