"""Descriptions whose numbers are rounded, so that axes which should be parallel are not quite."""

import copy

import numpy as np
from lxml import etree

from raff2urdf.placement import from_origin, inverse, roll_pitch_yaw
from raff2urdf.readers.urdf import hash_of, joints, origin, root_first


def rounded(urdf: str, constraints: dict, digits: int, seed: int) -> tuple[str, dict]:
    """Return a description whose base is rotated at random, and whose lengths and angles are rounded (m, rad).

    Seed 0: the base stays as it is.
    """
    tree = etree.fromstring(urdf.encode())
    root, rng, turned = root_first(tree)[0], np.random.default_rng(seed), np.eye(4)
    if seed:
        orthogonal = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turned[:3, :3] = orthogonal * np.linalg.det(orthogonal)

    def numbers(placement):
        values = (*placement[:3, 3], *roll_pitch_yaw(placement))
        return [round(float(value), digits) for value in values]

    for joint in joints(tree):
        placement = origin(joint, "")
        if joint.find("parent").get("link") == root:
            placement = turned @ placement
        written = numbers(placement)
        element = joint.find("origin")
        element = etree.SubElement(joint, "origin") if element is None else element
        element.set("xyz", " ".join(map(repr, written[:3])))
        element.set("rpy", " ".join(map(repr, written[3:])))
    values = copy.deepcopy(constraints)
    for loop in values["loops"]:
        for end in (loop["first"], loop["second"]):
            placement = np.array(end["placement"])
            written = numbers(turned @ placement if end["node"] == root else placement)
            end["placement"] = from_origin(written[:3], written[3:]).tolist()
    values["urdf_sha256"] = hash_of(tree, "")
    return etree.tostring(tree, encoding="unicode"), values


def largest_change(before: str, after: str) -> float:
    """Return the largest change of a joint's origin between two URDFs, m or rad."""
    pairs = zip(joints(etree.fromstring(before.encode())), joints(etree.fromstring(after.encode())), strict=True)
    changes = [inverse(origin(joint, "")) @ origin(other, "") for joint, other in pairs]
    return max(float(np.abs(change - np.eye(4)).max()) for change in changes)


def walker(legs: int = 2, tilt: float = 4e-5, digits: int = 6) -> str:
    """Return an SDF of one or two legs on a body, each a five-bar of two hips and two universal knees.

    Hips are tilted against each other by twice an angle (rad), and positions (m) are rounded, a unit up or down.
    """
    rng, parts = np.random.default_rng(0), ['<sdf version="1.9"><model name="walker"><link name="body"/>']
    axis = '<{0}><xyz expressed_in="__model__">{1}</xyz></{0}>'

    def link(name: str, place: np.ndarray, pitch: float) -> str:
        x, y, z = np.round(place + 10.0**-digits * rng.integers(-1, 2, 3), digits).tolist()
        return f'<link name="{name}"><pose>{x!r} {y!r} {z!r} 0 {round(pitch, digits)} 0</pose></link>'

    def joint(name: str, kind: str, parent: str, child: str, more: str) -> str:
        return f'<joint name="{name}" type="{kind}"><parent>{parent}</parent><child>{child}</child>{more}</joint>'

    for leg, (x, y) in enumerate([(0.25, 0.12), (-0.25, -0.12)][:legs]):
        for side in (1, -1):
            hip, knee = np.array([x + 0.02 * side, y, 0.0]), np.array([x + 0.11 * side, y, -0.05])
            upper, lower = f"upper_{leg}{side:+}", f"lower_{leg}{side:+}"
            parts += [link(upper, hip, 0.5 * side), link(lower, knee, 0.3 * side)]
            parts += [joint(f"hip_{leg}{side:+}", "revolute", "body", upper, axis.format("axis", f"{side * tilt} 1 0"))]
            across = axis.format("axis", "0 1 0") + axis.format("axis2", "1 0 0")
            parts += [joint(f"knee_{leg}{side:+}", "universal", upper, lower, across)]
        at = f'<pose relative_to="__model__">{x} {y} -0.2 0 0 0</pose>'
        foot = at + axis.format("axis", "0 1 0")
        parts += [joint(f"foot_{leg}", "revolute", f"lower_{leg}+1", f"lower_{leg}-1", foot)]
    return "\n".join([*parts, "</model></sdf>"])
