"""`cinegen page`: a page without a server, in one HTML file."""

from __future__ import annotations

from pathlib import Path

from cinegen.cli.files import check_outputs, write
from cinegen.cli.options import FILES, FORCE, RobotOptions, flag, option
from raff2urdf.command_line import UsageError
from raff2urdf.files import stem_of
from raff2urdf.shipped import find_robot


def run(
    options: RobotOptions,
    files: list[Path] = FILES,
    output: Path | None = option(
        "FILE.html",
        "file to write (default: named after the first FILE)",
        None,
        "-o",
        "--output",
        endings=(".html", ".htm"),
    ),
    base: list[str] = option(
        "NAME=POSE",
        "base pose of a robot: ROBOT.NODE, x,y,z[,roll,pitch,yaw] (m and degrees), or ROBOT.NODE@x,y,z...",
        (),
    ),
    edit: bool = flag("--edit", "show an editor of the RAFF text of one FILE beside its robots, which follow the text"),
    title: str | None = option("TEXT", "title of the page (default: the robots' names)"),
    force: bool = FORCE,
) -> int:
    """Write a page that holds robots and their solver, and needs no server.

    It opens from a disk or any static host, without a network; any part of any robot can be dragged, with closed loops.
    """
    if not files:
        raise UsageError("nothing to write: name a file of a robot")
    path = output or Path(f"{stem_of(files[0])}.html")
    check_outputs(path, force=force)
    from cinegen.page import build_editor, build_page
    from cinegen.session import Setup, base_poses
    from raff2urdf.raff.reader import read

    if edit:
        _check_editable(files, base, options)
        file = find_robot(files[0])
        page = build_editor(read(file), file.name, title or "", file.parent).encode(errors="backslashreplace")
        write(path, page)
        print(f"{path}: {len(page) / 1e6:.1f} MB, needs no server")
        return 0
    loaded = options.load(files)
    robots = {name: mechanism for name, (mechanism, _) in loaded.items()}
    poses = base_poses(robots, {name: str(file) for name, (_, file) in loaded.items()}, base)
    page = build_page(Setup(robots, poses), title or "").encode(errors="backslashreplace")
    write(path, page)
    print(f"{path}: {len(page) / 1e6:.1f} MB, needs no server")
    return 0


def _check_editable(files: list[Path], base: list[str], options: RobotOptions) -> None:
    """Check that one RAFF file is to be edited, and nothing is asked for that its text doesn't hold.

    Raises:
        UsageError: names what can't be combined with `--edit`.
        RaffError: there is no such file.
    """
    others = {
        "--base": base, "--robot": options.robot, "--loop": options.loop, "--ignore-loops": options.ignore_loops,
        "--ignore": options.ignore, "--relax/--no-relax": options.relax is not None, "--srdf": options.srdf,
    }  # fmt: skip
    given = ", ".join(name for name, value in others.items() if value)
    if given:
        raise UsageError(f"--edit: the page shows what the text defines: remove {given}")
    if len(files) != 1 or find_robot(files[0]).suffix.lower() != ".raff":
        raise UsageError("--edit: name one RAFF file (.raff), or one shipped robot")
