"""`cinegen.show`: the live page in a cell of a notebook, or in a browser."""

from __future__ import annotations

import html
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from cinegen.cockpit.cockpit import Cockpit
from cinegen.errors import CinegenWarning
from cinegen.model import Mechanism
from cinegen.session import Setup, arrange, map_setup


class LivePage:
    """Robots in a live page; as the value of a notebook's cell, the page is shown below it.

    Args:
        cockpit: cockpit that shows them.
        height: height of the page in a cell, pixels.

    Attributes:
        cockpit: cockpit that shows them.
    """

    def __init__(self, cockpit: Cockpit, height: int = 600) -> None:
        self.cockpit, self.height = cockpit, height

    def __repr__(self) -> str:
        return f"<{self.cockpit.title} at {self.url}>"

    def _repr_html_(self) -> str:
        url, title = html.escape(self.url), html.escape(self.cockpit.title)
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe src="{url}" title="{title}" style="{style}" allow="gamepad; fullscreen"></iframe>'

    @property
    def url(self) -> str:
        """Address of the page."""
        return self.cockpit.url

    @property
    def q(self) -> dict[str, NDArray[Any]]:
        """Configuration (nq,) of each robot, by name."""
        return {name: robot.q for name, robot in self.cockpit.state.robots.items()}

    def wait(self, seconds: float | None = None) -> None:
        """Wait until the time (s) is over, or until Ctrl-C: the page ends with the program."""
        self.cockpit.wait(seconds)

    def close(self) -> None:
        """End the session and its page."""
        self.cockpit.close()


def show(
    robots: Mechanism | Sequence[Mechanism] | Mapping[str, Mechanism] | Setup,
    follow: str | None = None,
    port: int = 7000,
    height: int = 600,
) -> LivePage:
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
    return LivePage(Cockpit(setup, port=port, own_process=False, framed=True), height)


def show_map(
    path: str | Path,
    quantity: str | None = None,
    mechanism: Mechanism | None = None,
    port: int = 7000,
    height: int = 600,
) -> LivePage:
    """Show a map with its robot in a live page, and return at once. A click on a cell moves the robot there.

    Args:
        path: path of the map (.zarr), which may be incomplete.
        quantity: quantity that colours the cells initially; the map's first unless given.
        mechanism: the map's robot as it was loaded, with its meshes; see `cinegen.session.map_setup`.
        port: first port to try.
        height: height of the page in a notebook's cell, pixels.

    Raises:
        MapError: there is no map.
        CinegenError: the map has no such quantity, or is of another robot; or the page can't be served.
    """
    return show(map_setup(path, quantity, mechanism), port=port, height=height)
