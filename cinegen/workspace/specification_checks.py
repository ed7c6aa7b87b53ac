"""Checks of a map's specification: its quantities and its scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cinegen.workspace.accuracy import check_tolerances
from cinegen.workspace.errors import MapError
from cinegen.workspace.loads import check_loads
from cinegen.workspace.quantities import QUANTITIES
from raff2urdf.errors import did_you_mean

if TYPE_CHECKING:
    from cinegen.workspace.specification import MapSpecification


def checked_quantities(spec: MapSpecification) -> tuple[str, ...]:
    """Return the names of a specification's quantities, each once, in the order of `QUANTITIES`.

    Raises:
        MapError: a quantity is unknown, or does not exist in this map.
    """
    mechanism, wanted = spec.mechanism, set(spec.quantities)
    for name in spec.quantities:
        if name not in QUANTITIES:
            raise MapError(f"unknown quantity '{name}'{did_you_mean(name, tuple(QUANTITIES))}")
    if "sigma_2" in wanted and not mechanism.structure.passive_rank and not spec.is_uncontrolled:
        wanted.discard("sigma_2")  # without passive joints there are no singularities of type 2
    check_loads(spec, wanted)
    check_tolerances(spec, wanted)
    if "clearance" in wanted:
        _check_scene_of(spec)
    if "solid_angle" in wanted and (spec.over_joints or spec.rotation):
        raise MapError("solid_angle counts possible directions of the node: leave its orientation free")
    if "solutions" in wanted and spec.over_joints and mechanism.is_constrained:
        from cinegen.assembly.errors import ModesError
        from cinegen.assembly.linkage import linkage_of

        try:
            linkage_of(mechanism.successive)
        except ModesError as error:
            raise MapError(f"its assembly modes can't be counted: {error}. Leave 'solutions' out") from None
    if "solutions" in wanted and not spec.over_joints and spec.dof > spec.rank:
        raise MapError(
            f"{mechanism.name} has infinitely many solutions here: it has {spec.dof} degrees of freedom, and the pose "
            f"of {spec.node} takes {spec.rank} of them. Leave 'solutions' out, or give its orientation too"
        )
    return tuple(name for name in QUANTITIES if name in wanted)


def _check_scene_of(spec: MapSpecification) -> None:
    """Check that the scene can be read.

    Raises:
        MapError: there is none, or it can't be read.
    """
    from cinegen.collision import PlanningError, scene_of

    if spec.scene is None:
        raise MapError("clearance needs obstacles: give a scene (--scene)")
    try:
        scene_of(dict(spec.scene), spec.folder, mechanism=spec.mechanism)
    except PlanningError as error:
        raise MapError(f"the scene can't be read: {error}") from None
