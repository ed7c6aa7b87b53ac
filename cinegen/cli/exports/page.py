"""`cinegen page`: a page without a server, in one HTML file."""

from __future__ import annotations

from pathlib import Path

from cinegen.cli.files import check_outputs, write
from cinegen.cli.options import BASE, FILES, RobotOptions, force_option, output_option
from raff2urdf.command.command_line import UsageError, option
from raff2urdf.files import stem_of


def run(
    options: RobotOptions,
    files: list[Path] = FILES,
    output: Path | None = output_option(
        "FILE.html", "file to write (default: named after the first FILE)", ".html", ".htm"
    ),
    base: list[str] = BASE,
    title: str | None = option("TEXT", "title of the page (default: the robots' names)"),
    force: bool = force_option(),
) -> int:
    """Write a page that holds robots and their solver, and needs no server.

    It opens from a disk or any static host, without a network; any part of any robot can be dragged, with closed loops.
    """
    if not files:
        raise UsageError("nothing to write: name a file of a robot")
    path = output or Path(f"{stem_of(files[0])}.html")
    check_outputs(path, force=force)
    from cinegen.page import build_page
    from cinegen.session import Setup, base_poses

    loaded = options.load(files)
    robots = {name: mechanism for name, (mechanism, _) in loaded.items()}
    poses = base_poses(robots, {name: str(file) for name, (_, file) in loaded.items()}, base)
    page = build_page(Setup(robots, poses), title or "").encode(errors="backslashreplace")
    write(path, page)
    print(f"{path}: {len(page) / 1e6:.2f} MB, needs no server")
    return 0
