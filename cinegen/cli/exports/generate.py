"""`cinegen generate`: source code of a robot's kinematics."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from cinegen.cli.files import check_outputs
from cinegen.cli.options import FILE, RobotOptions, force_option
from cinegen.errors import CinegenError
from raff2urdf.command.command_line import FOLDER, UsageError, option, quantity_option
from raff2urdf.files import write_all, writing
from raff2urdf.quantities import FREQUENCY

FUNCTIONS = ("fk", "close", "tick", "sigma", "ik")
"""Values of `cinegen.codegen.Function`, whose import takes longer than help may."""


def run(
    options: RobotOptions,
    file: Path = FILE,
    to: Literal["c", "js"] = option(None, "language: C99, or JavaScript (an ES module)", ...),
    output: Path = option("FOLDER", "folder of the files", Path(), "-o", "--output", endings=FOLDER),
    functions: str = option("LIST", f"what the code can do: {','.join(FUNCTIONS)} (default: all)", ",".join(FUNCTIONS)),
    task: list[str] = option(
        "NODE", "node that follows a target; NODE:position leaves its orientation free (default: the last node)", ()
    ),
    precision: Literal["double", "float"] = option(None, "numbers of the code: double, or float (C only)", "double"),
    rate: float = quantity_option("HZ", "ticks per second (Hz)", FREQUENCY, 240.0),
    name: str | None = option(
        "NAME", "name of the files, and prefix of C's names (default: the file, and its robot if --robot names one)"
    ),
    force: bool = force_option(),
) -> int:
    """Generate source code of a robot's kinematics, without dependencies.

    The code is translated from the kernels that cinegen runs: loops are closed and ticks are solved by the same
    equations, within limits, without allocation. A program beside it tests it with cases that Python has computed.
    """
    chosen = [function.strip() for function in functions.split(",") if function.strip()]
    for function in chosen:
        if function not in FUNCTIONS:
            raise UsageError(f"--functions: there is no '{function}'; use {', '.join(FUNCTIONS)}")
    if precision == "float" and to == "js":
        raise UsageError("--precision float: JavaScript computes with doubles only; use --to c")
    key, mechanism = options.load_one(file)
    from cinegen.codegen import Function, Language, generate, name_of

    prefix = name_of(f"{key}_{options.robot}" if options.robot else key)  # robots of a file replace none
    language = Language.C_FLOAT if precision == "float" else Language(to)
    files = generate(
        mechanism, language, tasks=task, functions=[Function(function) for function in chosen], dt=1.0 / rate,
        name=name or prefix, source=file.name,
    )  # fmt: skip
    paths = {output / name: text.encode() for name, text in files.items()}
    check_outputs(*paths, force=force)
    with writing(CinegenError):
        write_all(paths)
    print("\n".join(map(str, paths)))
    return 0
