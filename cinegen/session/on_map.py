"""`on_map`: a session with the robot of a map, and the map beside it."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

from lxml import etree

from cinegen.errors import CinegenWarning, LoadError
from cinegen.model import Mechanism
from cinegen.model.load import build
from cinegen.session.setup import MapBeside, Setup, SetupError, arrange
from cinegen.session.surroundings import in_scene
from raff2urdf.errors import did_you_mean


def on_map(path: str | Path, quantity: str | None = None, mechanism: Mechanism | None = None) -> Setup:
    """A session with the robot of a map, among the map's obstacles where it has some.

    Args:
        path: of the map, finished or not.
        quantity: that the cells are coloured by at first; the map's first unless given.
        mechanism: the map's, as its file was loaded here: for its meshes, where the map was made on another machine.
            Without it the robot is a stick figure where they aren't found.

    Raises:
        MapError: there is no map.
        SetupError: it has no such quantity, or is of another robot.
    """
    from cinegen.workspace.storage.store import Store

    where = Path(path).absolute()
    with warnings.catch_warnings():  # they were told when it was made
        warnings.simplefilter("ignore", CinegenWarning)
        spec = Store(where).spec
    if quantity is not None and quantity not in spec.quantities:
        known = f"it has {', '.join(spec.quantities) or 'none'}"
        raise SetupError(f"{path}: no quantity '{quantity}'{did_you_mean(quantity, spec.quantities)}; {known}")
    if mechanism is None:
        mechanism = _drawable(spec.mechanism)
    elif replace(spec, mechanism=mechanism).robot_hash != spec.robot_hash:
        raise SetupError(f"{path} is a map of another robot than {mechanism.name}, or of another version of it")
    if spec.scene is None:
        robot = " ".join(mechanism.name.replace("/", "-").split()) or "robot"  # as the page's scene can have it
        with warnings.catch_warnings():  # of ports: who shows a map has not asked for sensors
            warnings.simplefilter("ignore", CinegenWarning)
            setup = arrange({robot: mechanism})
    else:
        from cinegen.collision.scene import scene_of

        setup = in_scene(scene_of(dict(spec.scene), spec.folder, mechanism=mechanism))
        assert setup.surroundings is not None
        robot = setup.surroundings.robot
    return replace(setup, map=MapBeside(str(where), robot, spec.node, quantity))


def _drawable(mechanism: Mechanism) -> Mechanism:
    """A mechanism; without its shapes where they can't be found."""
    try:
        _ = mechanism.visual
    except LoadError:
        source = mechanism.source
        urdf = etree.fromstring(source.urdf.encode())
        for shape in list(urdf.iter("visual", "collision")):
            shape.getparent().remove(shape)
        beside = None if source.constraints is None else dict(source.constraints)
        return build(etree.tostring(urdf, encoding="unicode"), beside, None, source.name)
    return mechanism
