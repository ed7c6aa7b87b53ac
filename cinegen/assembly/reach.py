"""Whether universal joints let a rod lie as its platform asks."""

from __future__ import annotations

import numpy as np

from cinegen.assembly.families import Groups, Rod
from cinegen.assembly.linkage import Array

_ROUNDING = 1e-9


def is_out_of_reach(groups: Groups, rod: Rod, platform: int, placement: Array, motors: Array) -> bool:
    """Whether one of a rod's universal joints can't be assembled with the platform there.

    A universal joint's second axis keeps its angles with the first and with the rod. Three directions with angles of
    given cosines exist if, and only if, the determinant of their scalar products is not negative.

    Args:
        groups: of the linkage.
        rod: from base to platform.
        platform: the platform's group.
        placement: (4, 4) of the platform's first body in the base, without unit.
        motors: (motors,) values.
    """
    own = groups.placements(rod.body, motors)
    sides = (
        (groups.base, groups.placements(groups.base, motors)),
        (platform, {m: placement @ there for m, there in groups.placements(platform, motors).items()}),
    )
    inner = [groups.point(end, rod.body, own) for end in rod.ends]
    outer = [groups.point(end, group, there) for end, (group, there) in zip(rod.ends, sides, strict=True)]
    along_inner, along_outer = _unit(inner[1] - inner[0]), _unit(outer[1] - outer[0])
    for end, (group, there) in zip(rod.ends, sides, strict=True):
        if len(end.joints) != 2:
            continue
        outer_joint, inner_joint = end.joints
        if group not in {groups.of[side] for side in outer_joint.sides}:
            outer_joint, inner_joint = inner_joint, outer_joint
        a = float(outer_joint.along @ inner_joint.along)
        b = float(groups.direction(inner_joint, own) @ along_inner)
        c = float(groups.direction(outer_joint, there) @ along_outer)
        if 1.0 - a * a - b * b - c * c + 2.0 * a * b * c < -_ROUNDING:
            return True
    return False


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))
