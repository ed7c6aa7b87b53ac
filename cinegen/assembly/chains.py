"""The family of a linkage in which a node is fixed at a pose, and its number of inverse solutions.

Besides the families of assembly modes these are known (R: revolute, P: prismatic):

    chain        six joints in series: 16 (6R: E. Primrose, "On the input-output equation of the general 7R mechanism",
                 Mechanism and Machine Theory 21, 1986; H. Lee, C. Liang, "Displacement analysis of the general spatial
                 7-link 7R mechanism", ibid. 23, 1988), 16 (5R1P), 8 (4R2P), 2 (3R3P) (M. Raghavan, B. Roth, "Inverse
                 kinematics of the general 6R manipulator and related linkages", J. Mechanical Design 115, 1993)
    wrist        three successive revolute axes through one point, or parallel: 8 of 6R (D. Pieper, "The kinematics of
                 manipulators under computer control", 1968; C. Mavroidis, B. Roth, "Structural parameters which reduce
                 the number of manipulator configurations", J. Mechanical Design 116, 1994)
    ball         three joints and a ball joint: the same as with a wrist, whose two configurations are one: 4 of 3R
    one axis     revolute axes that are all parallel, and prismatic joints: a circle and a line meet in 2 points
    dyads        two bodies and three hinges in a plane or about a point, several times one after the other: 2 each time
    elbow        an arm on a hinge or a prismatic joint, and rods from it: a circle and a sphere meet in 2 points
    telescope    a rod that a prismatic joint lengthens: 2, its length and the negative one
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cinegen.assembly.bodies import LinkageBodies, LinkageJoint
from cinegen.assembly.families import Family, RigidGroups, recognise
from cinegen.assembly.linkage import Linkage
from cinegen.joints import common_point
from raff2urdf.document import LoopKind

Array = NDArray[np.float64]

_SAME = 1e-8  # characteristic lengths, radians
_CHAIN = {0: 16, 1: 16, 2: 8, 3: 2}  # solutions of six joints, by the number of prismatic ones
_BALL = {0: 4, 1: 4, 2: 2, 3: 1}  # of three joints and a ball joint


def recognise_part(linkage: Linkage) -> Family | None:
    """Return the family of a linkage in which a node is fixed; None if it is none of the known ones."""
    found = recognise(linkage)
    if found is not None:
        return found
    series = _series(linkage.bodies)
    known = _of_series(linkage, series) if series is not None and not linkage.idle else None
    return known or _elbow(linkage) or _dyads(linkage)


def _family(name: str, description: str, bound: int) -> Family:
    return Family(name, description, bound, True)


def _series(bodies: LinkageBodies) -> list[LinkageJoint] | None:
    """Return the passive joints in their order from the base to the base; None unless they are one loop."""
    base, left, here = int(bodies.group[0]), list(bodies.passive), int(bodies.group[0])
    found = list[LinkageJoint]()
    while left:
        on = [joint for joint in left if here in (bodies.group_of[side] for side in joint.sides)]
        if len(on) != (2 if not found else 1):
            return None
        found.append(on[0])
        left.remove(on[0])
        (here,) = {bodies.group_of[side] for side in on[0].sides} - {here}
    return found if here == base and found else None


def _of_series(linkage: Linkage, series: list[LinkageJoint]) -> Family | None:
    bodies, dof = linkage.bodies, sum(3 if joint.kind is LoopKind.BALL else 1 for joint in series)
    prismatic = sum(joint.kind is LoopKind.PRISMATIC for joint in series)
    samples = [_series(linkage.bodies_at(q)) or [] for q in linkage.mechanism.samples]
    revolute = [k for k, joint in enumerate(series) if joint.kind is LoopKind.REVOLUTE]
    if bodies.telescopes:
        return _family("telescope", "a telescopic rod", 2)
    if dof < 6:
        if len(series) != dof or not all(_are_parallel([one[k] for k in revolute]) for one in samples):
            return None
        return _family("one axis", f"{dof} joints that rotate about one direction", 2 if len(revolute) > 1 else 1)
    if dof > 6 or prismatic > 3:
        return None
    joints = "six joints in series" if prismatic else "six revolute joints in series"
    if any(centre.dof == 3 for centre in bodies.centres):
        return _family("ball", "three joints and a ball joint in series", _BALL[prismatic])
    for k in range(len(series) - 2):
        triples = [one[k : k + 3] for one in samples]
        if all(_meet(triple) for triple in triples):
            return _family("wrist", f"{joints}, three axes through one point", 2 * _BALL[prismatic])
        if not prismatic and all(_are_parallel(triple) for triple in triples):
            return _family("wrist", f"{joints}, three axes parallel", 8)
    return _family("chain", joints, _CHAIN[prismatic])


def _are_parallel(joints: list[LinkageJoint]) -> bool:
    axes = np.array([joint.along for joint in joints]).reshape(-1, 3)
    revolute = all(joint.kind is LoopKind.REVOLUTE for joint in joints)
    return revolute and bool(np.abs(np.cross(axes, axes[:1])).max(initial=0.0) < _SAME)


def _meet(joints: list[LinkageJoint]) -> bool:
    if any(joint.kind is not LoopKind.REVOLUTE for joint in joints):
        return False
    found = common_point(*(np.array([getattr(joint, name) for joint in joints]) for name in ("at", "along")))
    return found is not None and found[1] < _SAME


def _elbow(linkage: Linkage) -> Family | None:
    """Return the family of an arm on a joint of one DoF, with rods from it to the base."""
    groups, bodies = RigidGroups(linkage), linkage.bodies
    rods = [rod for rod in groups.rods() if min(end.dof for end in rod.ends) > 1]
    arms = {group for rod in rods for group in rod.others} - {groups.base}
    around = {bodies.group_of[side] for joint in bodies.passive for side in joint.sides}
    around -= {bodies.group_of[side] for side in bodies.crosses}
    if len(arms) != 1 or around != {groups.base, *arms, *(rod.body for rod in rods)}:
        return None
    inner = [joint for joint in bodies.passive if {bodies.group_of[s] for s in joint.sides} == {groups.base, *arms}]
    if len(inner) != 1 or inner[0].kind is LoopKind.BALL:
        return None
    return _family("elbow", "an arm on one joint, and a rod", 2)


def _dyads(linkage: Linkage) -> Family | None:
    """Return the family of hinges in a plane that pairs of bodies are assembled by, one pair after the other."""
    bodies = linkage.bodies
    if not all(_are_parallel(linkage.bodies_at(q).passive) for q in linkage.mechanism.samples):
        return None
    ends = [{bodies.group_of[side] for side in joint.sides} for joint in bodies.passive]
    known, count = {int(bodies.group[0])}, 0
    left = set[int]().union(*ends) - known
    while left:
        roots = [next(iter(pair & left)) for pair in ends if len(pair & left) == 1]
        pair = next((p for p in ends if len(p) == 2 and p <= left and all(g in roots for g in p)), None)
        if pair is None:
            return None
        known, left, count = known | pair, left - pair, count + 1
    if len(ends) != 3 * count:
        return None
    return _family("dyads", f"{count} times two bodies and three hinges in a plane", 2**count)
