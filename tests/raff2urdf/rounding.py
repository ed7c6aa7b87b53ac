"""Descriptions whose numbers are rounded, so that axes which should be parallel are not quite."""

from __future__ import annotations

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
        found = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turned[:3, :3] = found * np.linalg.det(found)

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
    changes = [inverse(origin(one, "")) @ origin(other, "") for one, other in pairs]
    return max(float(np.abs(change - np.eye(4)).max()) for change in changes)
