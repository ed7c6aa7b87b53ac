"""The joints of an SDF that are the tree of a URDF; the others close loops."""

from __future__ import annotations

from collections.abc import Sequence

from raff2urdf.readers.sdf.model import GEARBOX, SdfJoint, SdfModel
from raff2urdf.tree import WORLD

SpanningTree = tuple[list[tuple[SdfJoint, bool]], list[SdfJoint], list[str], str]
"""The tree's joints, each with whether its parent and child are swapped; joints that close loops; links that no joint
reaches; the root."""


def spanning_tree(model: SdfModel) -> SpanningTree:
    """Choose the joints of the tree.

    The parent of a link is at the first joint of the file that reaches it: from its parent if any does, else from
    its child. Joints that plugins control come before others where a loop would else be cut at one of them.
    """
    named = {joint for joint, _ in model.driven}
    joints = [joint for joint in model.joints if joint.kind != GEARBOX]
    tree = _grown(model, joints)
    if any(joint.name in named for joint in tree[1]):
        return _grown(model, sorted(joints, key=lambda joint: joint.name not in named))
    return tree


def _grown(model: SdfModel, joints: Sequence[SdfJoint]) -> SpanningTree:
    """Return what `spanning_tree` does, of joints in their order of preference."""
    fixed = model.static or any(WORLD in (joint.parent, joint.child) for joint in joints)
    root = WORLD if fixed else model.root or _first(model, joints, set())
    reached, tree, remaining, detached = {root}, [], list(joints), []
    while True:
        ahead = next((j for j in remaining if j.parent in reached and j.child not in reached), None)
        step = ahead or next((j for j in remaining if j.child in reached and j.parent not in reached), None)
        if step is not None:
            remaining.remove(step)
            tree.append((step, ahead is None))
            reached |= {step.parent, step.child}
        elif len(reached - {WORLD}) < len(model.links):
            link = _first(model, remaining, reached)  # it stays at its pose, with all links connected to it
            detached.append(link)
            reached.add(link)
        else:
            return tree, remaining, detached, root


def _first(model: SdfModel, joints: Sequence[SdfJoint], reached: set[str]) -> str:
    """Return the first link, of those not reached, that is no joint's child; or else the first of them."""
    children = {joint.child for joint in joints}
    remaining = [link for link in model.links if link not in reached]
    return next((link for link in remaining if link not in children), remaining[0])
