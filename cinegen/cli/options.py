"""Arguments and options that several commands share, and the two functions that declare options."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

from cinegen.errors import CinegenError
from raff2urdf.command.command_line import UsageError, flag, option, quantity_option
from raff2urdf.command.extras import needs
from raff2urdf.command.read_flags import ReadFlags, loop_kinds_of
from raff2urdf.escape import one_line
from raff2urdf.files import stem_of
from raff2urdf.quantities import LENGTH, show_lengths_in

if TYPE_CHECKING:
    from cinegen.collision import Scene
    from cinegen.model import Mechanism


def force_option(needs: str = "") -> Any:
    """Return the option `--force`; `needs` are the options that name files, where some do."""
    what = "replace an existing file that cinegen did not generate, that was changed since, or a recording"
    return flag("--force", what, needs)


def output_option(metavar: str, help: str, *endings: str, needs: str = "") -> Any:
    """Return the option `-o`, `--output`, which names the file or the folder that is written."""
    return option(metavar, help, None, "-o", "--output", needs=needs, endings=endings)


def _show_units(unit: str) -> str:
    show_lengths_in(unit)
    return unit


def _check_drawable(picture: Path | None) -> Path | None:
    """Check that pictures can be drawn before anything is computed."""
    if picture is not None:
        with needs("plot", "pictures"):
            import matplotlib  # noqa: F401
    return picture


PICTURES = (".png", ".svg", ".pdf", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".eps")
"""Endings of pictures."""

FILE = typer.Argument(..., metavar="FILE", help="RAFF, URDF, SDF or MJCF file, or the name of a shipped robot")
FILES = typer.Argument(
    (), metavar="FILE", help="RAFF, URDF, SDF or MJCF files, or names of shipped robots", show_default=False
)
BASE = option(
    "NAME=POSE",
    "base pose of a robot: ROBOT.NODE, x,y,z[,roll,pitch,yaw] (m and degrees), or ROBOT.NODE@x,y,z...", (), "--base",
)  # fmt: skip
ROBOT = option("NAME", "the robot of this name")
WORKERS = option("N", "processes on this machine (default: its cores)", unless="--scheduler")
SCHEDULER = option("URL", "scheduler of a Dask cluster, such as tcp://node1:8786")
ACTUATED = option("JOINTS", "actuated joints, such as joint1,joint2 (default: those of the file, or else chosen)")
FIXED_BASE = flag("--fixed-base", "hold a floating base: nothing moves it")
IGNORE = option(
    "ELEMENT", "leave out loops and couplings of this name or element, such as pin or loop_joint", (),
    unless="--ignore-loops",
)  # fmt: skip
IGNORE_LOOPS = flag("--ignore-loops", "leave out all loops and couplings: every joint moves independently")
JSON = flag("--json", "print JSON: m, rad and s; docs/reference/json.md lists the keys")
NODE = option("NAME", "node whose pose is meant (default: the last of the file)")
PLOT = option("FILE", "draw a picture: .png, .svg or .pdf", callback=_check_drawable, endings=PICTURES)
PLOT_JOINTS = option(
    "FILE", "draw the joints over time: .png, .svg or .pdf", callback=_check_drawable, endings=PICTURES
)
STOP_AFTER = "stop after this time (s; default: at Ctrl-C)"
SELF_CLEARANCE = quantity_option(
    "LENGTH", "distance between links of the robot (default: the scene's)", LENGTH, needs="--scene"
)
SRDF = option("FILE", "SRDF with pairs of links that may collide (default: the one next to a URDF)")
UNITS = option(
    None, "unit of lengths in text and pictures; angles are in degrees", "m", callback=_show_units,
    unless="--json but --plot --plot-joints",
)  # fmt: skip
VIEW = flag("--view", "show the result in the page")


@dataclass(frozen=True)
class SceneRobotOptions(ReadFlags):
    """Options by which the robot of a scene is loaded."""

    actuated: str | None = ACTUATED
    ignore_loops: bool = IGNORE_LOOPS
    ignore: list[str] = IGNORE
    srdf: Path | None = SRDF
    fixed_base: bool = FIXED_BASE

    def load_scene(self, path: Path, self_clearance: float | None) -> Scene:
        """Return the scene of a file.

        Raises:
            CinegenError, raff2urdf.RaffError: the file can't be read.
        """
        from cinegen.collision import load_scene

        options, joints = self.options(), actuated_of(self.actuated)
        scene = load_scene(
            path, self.ignore_loops, self.ignore, self.srdf, self_clearance, self.fixed_base, joints, options
        )
        options.check(path)
        return scene


@dataclass(frozen=True)
class RobotOptions(SceneRobotOptions):
    """Which robots are loaded, and how."""

    robot: str | None = option("NAME", "load only the robot of this name")
    loop: list[str] = option(
        "NAME=KIND", "close a loop as rigid, prismatic, revolute or ball, instead of what the file declares", (),
        unless="--ignore-loops",
    )  # fmt: skip
    relax: bool | None = option(
        "", "loops that rounding or play of pins leaves open: use weaker joints (--exact: keep them; default: heal)",
        None, "--relax/--exact",
    )  # fmt: skip

    def load(self, files: Iterable[Path]) -> dict[str, tuple[Mechanism, Path]]:
        """Return all robots of all files with their file, by a unique name.

        Raises:
            CinegenError, raff2urdf.RaffError: a file can't be read, or holds no robot of that name.
        """
        from cinegen.model.load import load_with, robots

        options, loops, files = self.options(), loop_kinds_of(self.loop), list(files)
        actuated = actuated_of(self.actuated)
        loaded: dict[str, tuple[Mechanism, Path]] = {}
        for file in files:
            wanted = robots(file) if self.robot is None else [self.robot]
            for robot in wanted:
                mechanism = load_with(
                    options, file, robot=robot, loops=loops, ignore_loops=self.ignore_loops, ignore=self.ignore,
                    relax=self.relax, srdf=self.srdf, fixed_base=self.fixed_base, actuated=actuated,
                )  # fmt: skip
                name = shown_name(file, None if len(wanted) == 1 else mechanism.name)
                while name in loaded:
                    name += "'"
                loaded[name] = mechanism, file
        options.check(*files)
        return loaded

    def load_one(self, file: Path) -> tuple[str, Mechanism]:
        """Return the only robot of a file, behind its name.

        Raises:
            CinegenError, raff2urdf.RaffError: as `load`; or there are several robots.
        """
        robots = [(name, mechanism) for name, (mechanism, _) in self.load([file]).items()]
        if len(robots) > 1:
            names = ", ".join(mechanism.name for _, mechanism in robots)
            raise CinegenError(f"{file} holds several robots: name one by --robot ({names})")
        return robots[0]


@dataclass(frozen=True)
class ShownRobotOptions(RobotOptions):
    """Which robots are loaded, and how lengths are shown that are printed or drawn."""

    units: Literal["m", "mm"] = UNITS


def actuated_of(text: str | None) -> list[str] | None:
    """Return the joints that --actuated names; None if it is not given.

    Raises:
        UsageError: it lists none.
    """
    if text is None:
        return None
    joints = text.replace(",", " ").split()
    if not joints:
        raise UsageError("--actuated: name joints, such as joint1,joint2")
    return joints


def shown_name(file: Path, robot: str | None = None) -> str:
    """Return the name of a robot as it is shown: that of its file, and its own if the file holds several."""
    stem = one_line(stem_of(file).encode(errors="replace").decode())  # a file's name need not be UTF-8
    return f"{stem}.{robot}" if robot else stem


def exclude(**options: object) -> None:
    """Refuse options that were given together.

    Raises:
        UsageError: more than one value is neither None, False nor empty.
    """
    names = [f"--{name.replace('_', '-')}" for name, value in options.items() if value]
    if len(names) > 1:
        raise UsageError(f"{names[0]} and {names[1]} exclude each other: leave one out")
