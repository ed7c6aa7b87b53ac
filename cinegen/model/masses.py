"""Which bodies of a mechanism have masses, and which masses no body can have."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import pinocchio as pin

from raff2urdf.inertia import Inertia
from raff2urdf.raff.document import LoopKind
from raff2urdf.readers.urdf import inertia, links
from raff2urdf.readers.xml_file import parse_xml

if TYPE_CHECKING:
    from cinegen.model.mechanism import Mechanism


def massless(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the moving bodies without mass, see `Mechanism.massless`."""
    model, bodies = mechanism.model, dict[int, str]()  # by joint: the first node on it
    for node in mechanism.nodes:
        bodies.setdefault(model.frames[mechanism.frame_id(node)].parentJoint, node)
    with_mass = {0, *(joint for joint in bodies if model.inertias[joint].mass > 0.0)}
    for link in stated(mechanism):
        if not model.existFrame(link, pin.FrameType.BODY):  # between the joints of a ball joint
            continue
        with_mass.add(model.frames[model.getFrameId(link, pin.FrameType.BODY)].parentJoint)
    ends = [(loop.first, loop.second) for loop in mechanism.loops if loop.kind is LoopKind.RIGID]
    welded = [{model.frames[mechanism.frame_id(end)].parentJoint for end in pair} for pair in ends]
    for _ in welded:  # a chain of loops is no longer than their number
        for pair in welded:
            with_mass |= pair if pair & with_mass else set()
    return tuple(node for joint, node in bodies.items() if joint > 0 and joint not in with_mass)


def unphysical(mechanism: Mechanism) -> Mapping[str, str]:
    """Return the links whose inertia no body can have, see `Mechanism.unphysical`."""
    reasons = {link: body.why_unphysical() for link, body in stated(mechanism).items()}
    return {link: why for link, why in reasons.items() if why is not None}


def stated(mechanism: Mechanism) -> Mapping[str, Inertia]:
    """Return the inertia of each link whose mass the mechanism's file states, 0 too, in the link's own axes."""
    return mechanism.structure.derived(_stated)


def _stated(mechanism: Mechanism) -> Mapping[str, Inertia]:
    name = mechanism.source.name
    bodies = {str(link.get("name")): inertia(link, name) for link in links(parse_xml(mechanism.source.urdf, name))}
    return {link: body for link, body in bodies.items() if body is not None}
