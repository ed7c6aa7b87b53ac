"""Reports of which links are checked against each other, and how exactly."""

from __future__ import annotations

from typing import Any

import coal

from cinegen.collision.body import Body
from cinegen.collision.clearance import Clearance
from cinegen.collision.self_collision import LinkPairs, PairReason, disabled_by_srdf, link_pairs
from cinegen.model import Mechanism


def collision_report(mechanism: Mechanism) -> dict[str, Any]:
    """Return the shapes with which a mechanism's links collide, and why each pair is checked, or not.

    Returns:
        `shapes`: the link of each, its exact shape, and the convex shape around it; `pairs`: two links, the reason, and
        for checked ones in contact at home, `depth_at_home`: by how much the convex shapes overlap, m, at most that
        deep are the exact ones.
    """
    links: LinkPairs = mechanism.derived(link_pairs)
    clearance = Clearance(mechanism, links.bodies, (), links.of(PairReason.CHECKED))
    depths = dict(zip(links.of(PairReason.CHECKED), (-clearance.distances(mechanism.q_home)).tolist(), strict=True))
    srdf, disabled = mechanism.source.srdf, disabled_by_srdf(mechanism)
    pairs = []
    for pair, reason in links.reasons.items():
        names = [links.bodies[i].name for i in pair]
        found: dict[str, Any] = {"links": names, "reason": reason.value}
        if srdf is not None and reason is PairReason.SRDF:
            found["reason"] = f"disabled by {srdf['file']}: {disabled[frozenset(names)] or 'no reason given'}"
        if depths.get(pair, -1.0) >= 0.0:
            found["depth_at_home"] = depths[pair]
        pairs.append(found)
    shapes = [
        {"link": body.name, "shape": _text(body.as_described), "around": _text(body) if body.exact else None}
        for body in links.bodies
    ]
    return {"shapes": shapes, "pairs": pairs}


def _text(body: Body) -> str:
    if isinstance(body.shape, coal.BVHModelOBBRSS):
        return f"mesh of {body.shape.num_tris} triangles"
    if isinstance(body.shape, coal.Convex):
        return f"hull of {body.shape.num_points} corners"
    return type(body.shape).__name__.lower()
