"""`cinegen.show`: the live page in a cell of a notebook, or in a browser."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

from cinegen.cockpit.cockpit import Cockpit
from cinegen.errors import CinegenWarning
from cinegen.model import Mechanism
from cinegen.session import Setup, arrange, map_setup


def show(
    robots: Mechanism | Sequence[Mechanism] | Mapping[str, Mechanism] | Setup,
    follow: str | None = None,
    port: int = 7000,
    height: int = 600,
) -> Cockpit:
    """Show robots in a live page, in which any part can be dragged, and return at once.

    Args:
        robots: one robot, several, several by their names in the page, or the setup of a session.
        follow: shape of the path that each robot's end follows until it is dragged: circle, figure8 or line.
        port: first port to try.
        height: height of the page in a notebook's cell, pixels.

    Raises:
        CinegenError: the page can't be served.
    """
    if isinstance(robots, Setup):
        setup = robots
    else:
        if isinstance(robots, Mechanism):
            robots = [robots]
        if not isinstance(robots, Mapping):
            named: dict[str, Mechanism] = {}
            for robot in robots:
                name = robot.name
                while name in named:
                    name += "'"
                named[name] = robot
            robots = named
        with warnings.catch_warnings():  # of missing ports: no sensor was requested
            warnings.simplefilter("ignore", CinegenWarning)
            setup = arrange(robots, follow=follow)
    return Cockpit(setup, port=port, own_process=False, framed=True, height=height)


def show_map(
    path: str | Path,
    quantity: str | None = None,
    mechanism: Mechanism | None = None,
    port: int = 7000,
    height: int = 600,
) -> Cockpit:
    """Show a map with its robot in a live page, and return at once. A click on a cell moves the robot there.

    Args:
        path: path of the map (.zarr), which may be incomplete.
        quantity: quantity that colours the cells initially; the map's first unless given.
        mechanism: the map's robot as it was loaded, with its meshes; see `cinegen.session.scene_setup`.
        port: first port to try.
        height: height of the page in a notebook's cell, pixels.

    Raises:
        MapError: there is no map.
        CinegenError: the map has no such quantity, or is of another robot; or the page can't be served.
    """
    return show(map_setup(path, quantity, mechanism), port=port, height=height)
