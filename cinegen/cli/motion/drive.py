"""`cinegen drive`: a page in which robots are driven."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cinegen.cli.files import check_outputs, disabled_pairs, unchecked_links
from cinegen.cli.options import BASE, FILES, SELF_CLEARANCE, ShownRobotOptions
from cinegen.cli.served_page import PageOptions, write_snapshot
from raff2urdf.command.command_line import UsageError, no_effect, option, quantity_option
from raff2urdf.errors import counted
from raff2urdf.files import stem_of
from raff2urdf.quantities import FREQUENCY, LENGTH, shown

if TYPE_CHECKING:
    from cinegen.session import Setup


def run(
    robots: ShownRobotOptions,
    page: PageOptions,
    files: list[Path] = FILES,
    scene: Path | None = option("SCENE.toml", "drive a robot among obstacles, instead of FILE"),
    follow: Literal["circle", "figure8", "line", "still"] | None = option(
        None,
        "path of the end effector, as large as workspace and limits allow (default: circle; in a scene still: none)",
    ),
    node: str | None = option("NAME", "node that follows it (default: the last of the file)"),
    sensor: list[str] = option(
        "N=URL",
        "another port for sensor N of the files; NODE=URL: a sensor for any node; URL#axes=x,-z,y changes its axes",
        (),
    ),
    base: list[str] = BASE,
    record: Path | None = option(
        "FILE.jsonl", "record the motion, for `cinegen replay` and `export`", endings=(".jsonl",)
    ),
    snapshot: Path | None = option(
        "FILE.html",
        "write a snapshot, an HTML file to look at: now, or after --seconds",
        unless="--video",
        endings=(".html", ".htm"),
    ),
    self_clearance: float | None = SELF_CLEARANCE,
    lock: str | None = option("JOINTS", "joints that do not move until they are unlocked, such as joint3,arm.joint4"),
    rate: float = quantity_option("HZ", "ticks per second (Hz)", FREQUENCY, 1000.0, least=10.0, most=1e4),
) -> int:
    """Drive robots in a page: drag any part, move actuated joints, plug in sensors.

    Serves a page to this machine in which any part of any robot can be dragged; loops stay closed. Until someone drags
    it, the end of each robot follows a path. In a scene, the robot keeps clear of the obstacles, which can be dragged
    too.
    """
    if snapshot and page.seconds is None:
        no_effect(
            "with --snapshot alone, which serves no page", "--record", "--port", "--host", "--token", "--no-token",
            "--https", "--realtime", "--no-browser", remedy="add --seconds, after which the snapshot is written",
        )  # fmt: skip
    check_outputs(snapshot, force=page.force)
    check_outputs(record, force=page.force, remakeable=False)
    if scene is None and not files:
        raise UsageError("nothing to drive: name a file of a robot, or a scene with --scene SCENE.toml")
    if scene is not None and files:
        raise UsageError("--scene names its robot: leave FILE out")
    if scene is not None:
        no_effect("with --scene, which names its robot", "--robot", "--loop", "--base", "--relax")
    recorded, locked = str(record) if record else None, lock.replace(",", " ").split() if lock else []

    def read() -> Setup:
        from cinegen.session import arrange, scene_setup

        shape = follow or ("circle" if scene is None else "still")
        path = None if shape == "still" else shape
        if scene is not None:
            loaded = robots.load_scene(scene, self_clearance)
            setup = scene_setup(loaded, sensor, path, node, rate, recorded)
        else:
            named = robots.load(files)
            mechanisms = {name: mechanism for name, (mechanism, _) in named.items()}
            sources = {name: str(file) for name, (_, file) in named.items()}
            setup = arrange(mechanisms, sources, sensor, path, node, base, rate, recorded)
        return replace(setup.with_locked(locked), overwrite=page.force)

    return serve(read, page, stem_of(scene or [*files, Path()][0]), snapshot)


def serve(read: Callable[[], Setup], page: PageOptions, stem: str, snapshot: Path | None = None) -> int:
    """Describe a session, then serve its page until it ends, or only write a snapshot; return the exit code.

    Args:
        read: returns the setup of the session, as its files describe it now: they are read again when they are saved.
        page: options of the page.
        stem: of the snapshot that is written without a terminal.
        snapshot: file of the snapshot.
    """
    from cinegen.cockpit import SetupFiles

    setup, files = SetupFiles.of(read)
    setup = replace(setup, overwrite=page.force)
    _describe(setup)
    if snapshot and page.seconds is None and not page.video:
        from cinegen.cockpit import Page, draw, title_of

        drawing = Page(title_of(setup))
        draw(drawing, setup)
        write_snapshot(snapshot, drawing.html())
        return 0
    return page.show(setup, stem, snapshot, files)


def _describe(setup: Setup) -> None:
    for name, mechanism in setup.robots.items():
        line = f"{name}: {counted(len(mechanism.joints), 'joint')}, {counted(len(mechanism.loops), 'loop')}"
        line += f", {counted(len(mechanism.couplings), 'coupling')}" if mechanism.couplings else ""
        line += f", mobility {mechanism.mobility}"
        print(
            f"{line}, loops closed to {mechanism.closure(mechanism.q_home):.1g}" if mechanism.is_constrained else line
        )
        if setup.avoidance is not None and mechanism.source.srdf:
            print(f"  {disabled_pairs(mechanism)}")
        if setup.avoidance is not None and (lost := unchecked_links(mechanism)):
            print(f"  {lost}")
    if setup.avoidance is not None:
        print(
            f"keeps {shown(setup.avoidance.scene.safety, LENGTH)} clear of {counted(len(setup.obstacles), 'obstacle')}"
        )
