"""`map_setup`: the setup of a session with a map and its robot."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

from cinegen.errors import CinegenWarning
from cinegen.model import Mechanism
from cinegen.session.scene_setup import scene_setup
from cinegen.session.setup import MapOverlay, Setup, SetupError, arrange
from raff2urdf.errors import did_you_mean


def map_setup(path: str | Path, quantity: str | None = None, mechanism: Mechanism | None = None) -> Setup:
    """Return the setup of a session with the robot of a map, among the map's obstacles if it has some.

    Args:
        path: path of the map, which may be incomplete.
        quantity: quantity that colours the cells initially; the map's first unless given.
        mechanism: the map's robot, loaded from its file, if the map is far from it. Otherwise its meshes
            are not found there, and it is drawn as a stick figure.

    Raises:
        MapError: there is no map.
        SetupError: the map has no such quantity, or is of another robot.
    """
    from cinegen.workspace.zarr_store import MapStore

    where = Path(path).absolute()
    with warnings.catch_warnings():  # they were issued when it was made
        warnings.simplefilter("ignore", CinegenWarning)
        spec = MapStore(where).spec
    if quantity is not None and quantity not in spec.quantities:
        known = f"it has {', '.join(spec.quantities) or 'none'}"
        raise SetupError(f"{path}: no quantity '{quantity}'{did_you_mean(quantity, spec.quantities)}; {known}")
    if mechanism is None:
        source = spec.mechanism.source._replace(owner=str(where.parent))
        mechanism = replace(spec.mechanism, source=source)
    elif replace(spec, mechanism=mechanism).robot_hash != spec.robot_hash:
        raise SetupError(f"{path} is a map of another robot than {mechanism.name}, or of another version of it")
    if spec.scene is None:
        robot = " ".join(mechanism.name.replace("/", "-").split()) or "robot"  # as the page's scene requires
        with warnings.catch_warnings():  # of ports: no sensor was requested
            warnings.simplefilter("ignore", CinegenWarning)
            setup = arrange({robot: mechanism})
    else:
        from cinegen.collision import scene_of

        setup = scene_setup(scene_of(dict(spec.scene), spec.folder, mechanism=mechanism))
        assert setup.avoidance is not None
        robot = setup.avoidance.robot
    return replace(setup, map=MapOverlay(str(where), robot, spec.node, quantity))
