"""`cinegen heal`: exact numbers for loops that are nearly redundant."""

from __future__ import annotations

import math
from pathlib import Path

import typer

from cinegen.cli.files import check_outputs, print_result, write
from cinegen.cli.options import FILE, JSON, force_option
from cinegen.errors import CinegenError
from raff2urdf.command.command_line import option
from raff2urdf.command.read_flags import ReadFlags
from raff2urdf.errors import counted
from raff2urdf.files import STANDARD, output_path, signed

OUT = typer.Argument(..., metavar="OUT", help="healed file, in the same format; - for standard output")


def run(
    reading: ReadFlags,
    file: Path = FILE,
    out: str = OUT,
    robot: str | None = option("NAME", "robot of a file with several (default: the first)"),
    json: bool = JSON,
    force: bool = force_option(),
) -> int:
    """Correct rounded numbers, so that loops that are nearly redundant can move.

    Joints' placements and axes, and the ends of loops, change as little as possible (least squares), so that axes
    become parallel, perpendicular or intersecting as they are meant to be, and all loops close. Each changed number is
    listed. Only these differ in OUT, which has the format of FILE.
    """
    from cinegen.model.healing.heal_file import heal_file
    from cinegen.typed_json import as_json
    from raff2urdf.readers.loops.sidecar import constraints_of
    from raff2urdf.shipped import find_robot

    file = find_robot(file)
    target = output_path(out, file.name)
    if target != STANDARD and target.suffix.lower() != file.suffix.lower():
        raise CinegenError(f"{out}: heal keeps the format: name a file that ends with {file.suffix}")
    names = {file: target, constraints_of(file): constraints_of(target)}
    check_outputs(target, force=force, json=json)
    healing = heal_file(file, robot, target, reading.options())
    if target != STANDARD:
        others = [names[path] for path in healing.contents if path != file]
        check_outputs(*others, force=force)
    for path, content in healing.contents.items():
        write(names[path], signed(content))
    numbers = [
        as_json(
            edit.number, "line", "name", file=str(edit.number.file), old=edit.number.value, new=edit.value,
            change=edit.change, unit="m" if edit.number.is_length else "rad",
        )
        for edit in healing.numbers
    ]  # fmt: skip
    loops = [{"name": name, "gap_m": gap, "gap_rad": angle} for name, (gap, angle) in healing.gaps.items()]
    lines = [
        f"loop '{name}' was open by {gap * 1e3:.2g} mm and {math.degrees(angle):.2g} degrees"
        for name, (gap, angle) in healing.gaps.items()
    ]
    for edit in healing.numbers:
        size = f"{edit.change * 1e3:+.2g} mm" if edit.number.is_length else f"{math.degrees(edit.change):+.2g} degrees"
        place = f"{edit.number.file.name}:{edit.number.line}: {edit.number.name}"
        lines.append(f"{place}: {edit.number.text} -> {edit.value!r} ({size})")
    written = " and ".join(str(names[path]) for path in healing.contents)
    lines.append(f"{counted(len(numbers), 'number')} changed; {written} written")
    print_result({"file": str(file), "output": str(target), "loops": loops, "numbers": numbers}, "\n".join(lines), json)
    return 0
