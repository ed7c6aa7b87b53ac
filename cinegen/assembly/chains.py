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
    dyads        such a series and pairs of bodies on three parallel hinges (a five-bar, the parallelogram of an arm),
                 one of which may be a prismatic joint instead (a hydraulic cylinder): 2 for each pair
    elbow        an arm on a hinge or a prismatic joint, and rods from it: a circle and a sphere meet in 2 points
    telescope    a rod that a prismatic joint lengthens: 2, its length and the negative one
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cinegen.assembly.bodies import LinkageBodies, LinkageJoint
from cinegen.assembly.families import Family, RigidGroups, recognise
from cinegen.assembly.linkage import Linkage
from cinegen.assembly.six_revolutes import SixRevolutes
from cinegen.joints import common_point
from raff2urdf.errors import counted
from raff2urdf.raff.document import LoopKind

_SAME = 1e-8  # characteristic lengths, radians
_CHAIN = {0: 16, 1: 16, 2: 8, 3: 2}  # solutions of six joints, by the number of prismatic ones
_BALL = {0: 4, 1: 4, 2: 2, 3: 1}  # of three joints and a ball joint


def recognise_part(linkage: Linkage) -> Family | None:
    """Return the family of a linkage in which a node is fixed; None if it is none of the known ones."""
    family = recognise(linkage)
    if family is not None or linkage.has_mimics:
        return family
    samples = [linkage.bodies_at(q) for q in linkage.mechanism.structure.samples]
    left, dyads = _without_dyads(samples)
    series = _series(linkage.bodies, left)
    known = _of_series(linkage, samples, series) if series is not None else None
    if known is not None and dyads:
        pairs = f"{counted(dyads, 'pair')} of bodies on three hinges beside {known.description}"
        return _family("dyads", pairs, known.bound * 2**dyads)
    return known or _elbow(linkage)


def _family(name: str, description: str, bound: int) -> Family:
    return Family(name, description, bound, True)


def _without_dyads(samples: list[LinkageBodies]) -> tuple[list[int], int]:
    """Return the passive joints that are left without pairs of bodies on three parallel hinges, and how many pairs
    there are. One of the hinges may be a prismatic joint instead, at right angles to the others."""
    bodies, count = samples[0], 0
    ends = [frozenset(bodies.group_of[side] for side in joint.sides) for joint in bodies.passive]
    left = list(range(len(ends)))
    while _series(bodies, left) is None:
        on = {group: [k for k in left if group in ends[k]] for group in frozenset().union(*ends)}
        on.pop(int(bodies.group[0]), None)
        pairs = [{*on[a], *on[b]} for a, b in (sorted(ends[k]) for k in left if ends[k] <= on.keys())]
        pair = next((pair for pair in pairs if len(pair) == 3 and _is_dyad(samples, pair)), None)
        if pair is None:
            break
        left, count = [k for k in left if k not in pair], count + 1
    return left, count


def _is_dyad(samples: list[LinkageBodies], joints: set[int]) -> bool:
    """Return whether three joints are parallel hinges, at most one of them a prismatic joint at right angles."""
    for bodies in samples:
        hinges = [bodies.passive[k] for k in joints if bodies.passive[k].kind is LoopKind.REVOLUTE]
        others = [bodies.passive[k] for k in joints if bodies.passive[k].kind is LoopKind.PRISMATIC]
        if len(hinges) + len(others) < 3 or len(others) > 1 or not _are_parallel(hinges):
            return False
        if any(abs(float(other.along @ hinges[0].along)) > _SAME for other in others):
            return False
    return True


def _series(bodies: LinkageBodies, among: list[int]) -> list[int] | None:
    """Return some passive joints in their order from the base to the base; None unless they are one loop."""
    base, left, group = int(bodies.group[0]), list(among), int(bodies.group[0])
    ends = [{bodies.group_of[side] for side in joint.sides} for joint in bodies.passive]
    ordered = list[int]()
    while left:
        on = [k for k in left if group in ends[k]]
        if len(on) != (1 if ordered else 2) and not (len(left) == 1 and on):
            return None
        ordered.append(on[0])
        left.remove(on[0])
        group = next(iter(ends[on[0]] - {group}), group)
    return ordered if group == base and ordered else None


def _of_series(linkage: Linkage, samples: list[LinkageBodies], series: list[int]) -> Family | None:
    bodies, ordered = samples[0], [[sample.passive[k] for k in series] for sample in samples]
    joints = ordered[0]
    dof = sum(3 if joint.kind is LoopKind.BALL else 1 for joint in joints)
    prismatic = sum(joint.kind is LoopKind.PRISMATIC for joint in joints)
    if any(joint in bodies.telescopes for joint in joints):
        return _family("telescope", "a telescopic rod", 2)
    if dof < 6:
        revolute = [k for k, joint in enumerate(joints) if joint.kind is LoopKind.REVOLUTE]
        if len(joints) != dof or not all(_are_parallel([row[k] for k in revolute]) for row in ordered):
            return None
        turning, sliding = (
            f"{number} {kind} joint{'s' * (number > 1)}" if number else ""
            for number, kind in ((len(revolute), "revolute"), (prismatic, "prismatic"))
        )
        text = " and ".join(filter(None, [turning and f"{turning} about one direction", sliding]))
        return _family("one axis", text, 2 if len(revolute) > 1 else 1)
    if dof > 6 or prismatic > 3:
        return None
    chain = "six joints in series" if prismatic else "six revolute joints in series"
    if any(centre.dof == 3 and any(joint in joints for joint in centre.joints) for centre in bodies.centres):
        return _family("ball", "three joints and a ball joint in series", _BALL[prismatic])
    if not prismatic:
        special = SixRevolutes(linkage, series).special
        known = _family("wrist", f"{chain}, {special}", 8) if special else _family("chain", chain, _CHAIN[0])
        return replace(known, series=() if special or len(series) < len(samples[0].passive) else tuple(series))
    for k in range(len(joints) - 2):
        if all(_meet(row[k : k + 3]) for row in ordered):
            return _family("wrist", f"{chain}, three axes through one point", 2 * _BALL[prismatic])
    return _family("chain", chain, _CHAIN[prismatic])


def _are_parallel(joints: list[LinkageJoint]) -> bool:
    axes = np.array([joint.along for joint in joints]).reshape(-1, 3)
    revolute = all(joint.kind is LoopKind.REVOLUTE for joint in joints)
    return revolute and bool(np.abs(np.cross(axes, axes[:1])).max(initial=0.0) < _SAME)


def _meet(joints: list[LinkageJoint]) -> bool:
    if any(joint.kind is not LoopKind.REVOLUTE for joint in joints):
        return False
    nearest = common_point(*(np.array([getattr(joint, name) for joint in joints]) for name in ("at", "along")))
    return nearest is not None and nearest[1] < _SAME


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
