"""`cinegen demo`: the robots, scenes and examples that are shipped."""

from __future__ import annotations

import runpy
from dataclasses import replace
from pathlib import Path

import typer

from cinegen.cli.motion.drive import serve
from cinegen.cli.served_page import PAGE, PageOptions
from cinegen.errors import CinegenError
from raff2urdf.command.command_line import flag, no_effect
from raff2urdf.errors import did_you_mean
from raff2urdf.shipped import description, folder, reference_robots, robots, scenes

_FIRST = "delta4"


def run(
    page: PageOptions,
    name: str = typer.Argument(_FIRST, metavar="NAME", help="a robot, a scene or an example"),
    listing: bool = flag("--list", "list robots, scenes and examples"),
) -> int:
    """Open a robot, a scene or an example that is shipped with cinegen, or a reference robot of Pinocchio.

    A robot or a scene is driven in a page, as by `cinegen drive`, without the sensors of its file; an example, which is
    a short program, is run. Reference robots come with the extra `robots`, and `cinegen validate` lists them. Another
    folder's robots are driven by `cinegen drive FILE`.
    """
    if listing:
        no_effect("with --list", "NAME", *PAGE)
        print("\n".join(_listed()), flush=True)
        return 0
    known = {**reference_robots(), **robots()}
    if name in known:
        return _drive_robot(name, known[name], page)
    if name in scenes():
        from cinegen.collision import load_scene
        from cinegen.session import scene_setup

        return serve(lambda: scene_setup(load_scene(scenes()[name])), page, name)
    programs = _examples()
    if name not in programs:
        near = did_you_mean(name, (*known, *scenes(), *programs))
        raise CinegenError(f"no robot, scene or example '{name}'{near} (`cinegen demo --list` lists all)")
    no_effect(f"on an example ('{name}'), which is a program of its own", *PAGE)
    runpy.run_path(str(programs[name]), run_name="__main__")
    return 0


def _drive_robot(name: str, path: Path, page: PageOptions) -> int:
    from cinegen.model.load import load
    from cinegen.model.load import robots as robots_of
    from cinegen.session import Setup, arrange

    def read() -> Setup:
        mechanisms = {}
        names = robots_of(path)
        for robot in names:
            mechanism = load(path, robot)
            # the sensors of its file are not those of this machine
            mechanisms[name if len(names) == 1 else mechanism.name] = replace(mechanism, sensor_constraints=())
        return arrange(mechanisms, follow="circle")

    return serve(read, page, name)


def _examples() -> dict[str, Path]:
    """Return the programs of the examples by their names, without their numbers."""
    return {path.stem.partition("_")[2]: path for path in sorted(folder("cinegen", "examples").glob("[0-9]*.py"))}


def _listed() -> list[str]:
    """Return a line for each robot, scene and example, below a heading for each kind."""
    lines = []
    kinds = {"robots": robots(), "scenes": scenes(), "examples": _examples()}
    width = max(len(name) for kind in kinds.values() for name in kind)
    for kind, files in kinds.items():
        lines += ["", f"{kind}:"]
        for name, path in files.items():
            lines.append(f"  {name:{width}}  {description(path)}")
    return lines[1:]
