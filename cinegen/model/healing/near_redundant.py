"""Remedies for nearly redundant loops (`raff2urdf.loops.near_redundancy`): a healed geometry, or weaker joints."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree

from cinegen.arrays import Array
from cinegen.errors import warn
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.clusters import subsystems
from cinegen.model.healing.heal import LARGEST_CHANGE, heal, in_bodies, moved
from raff2urdf import closure
from raff2urdf.errors import counted
from raff2urdf.loops.near_redundancy import NearRedundancy, near_redundancy
from raff2urdf.loops.play import EXACT, play, text
from raff2urdf.placement import roll_pitch_yaw, translation
from raff2urdf.raff.document import LoopKind
from raff2urdf.readers.urdf import joints, origin
from raff2urdf.readers.urdf_file import parse
from raff2urdf.residual import ROWS


def made_exact(
    urdf: str, constraints: Mapping[str, Any], system: ClosedLoops, q: Array, relax: bool, name: str
) -> tuple[str, Mapping[str, Any]] | None:
    """Return a description whose loops are not nearly redundant, with one warning that reports what is changed.

    The geometry of each cluster of loops is healed; where that fails, its loops are closed by weaker joints, which may
    add to mobility. If neither succeeds, it stays as it is.

    Args:
        urdf: the text of the URDF.
        constraints: its loops.
        system: the same loops.
        q: (nq,) the configuration as written.
        relax: try weaker joints first.
        name: the file's, for the warning.

    Returns:
        None if no loop is nearly redundant.
    """
    tree = parse(urdf, name)
    kinds: dict[str, str] = {}
    twists: dict[tuple[str, str], Array] = {}
    texts, names = [], {joint.get("name") for joint in joints(tree)}
    for cluster, at in subsystems(system):
        start = closure.close(cluster, q[at]).q
        redundancy = near_redundancy(cluster, start, q[at])
        if redundancy is None:
            continue
        relaxed = _relaxed(cluster, start) if relax else None
        healed = _healed(cluster, redundancy, start, names) if relaxed is None else None
        if relaxed is None and healed is None and not relax:
            relaxed = _relaxed(cluster, start)
        if healed is not None:
            twists |= healed
            done = f"healed: placements changed by up to {_size(cluster, np.array(list(healed.values())))}"
        elif relaxed is not None:
            kinds |= {loop.name: kind.name.lower() for loop, kind in zip(cluster.loops, relaxed, strict=True)}
            done = f"relaxed: closed by {', '.join(sorted({kind.name.lower() for kind in relaxed}))} joints"
            more = redundancy.rank - closure.generic_rank(cluster.with_kinds(relaxed), start)[0]
            done += f", which adds {counted(more, 'degree')} of freedom" if more else ""
        else:
            done = "kept: neither small changes of the geometry nor weaker joints close it"
        gaps, kind = loop_gaps(cluster, redundancy), {loop.name: loop.kind.name.lower() for loop in cluster.loops}
        listed = ", ".join(f"loop '{key}' ({kind[key]}) by {_millimetres(*gap)}" for key, gap in gaps.items())
        texts.append(f"{listed}: {done}")
    if not texts:
        return None
    message = (
        f"{name}: nearly redundant loops: equations that would depend on each other, were the numbers not rounded, "
        "can't all be solved. They leave open"
    )
    advice = f"`cinegen heal` writes exact numbers; {EXACT} keeps all loops as written"
    warn("\n  ".join([message, *texts, advice]))
    length = np.repeat([system.length, 1.0], 3)
    steps = {key: pin.exp6(twist * length).homogeneous for key, twist in twists.items()}
    for joint in joints(tree):
        step = steps.get(("joint", joint.get("name")))
        if step is not None:
            _move_origin(joint, step)
    loops = [
        {
            **loop,
            "kind": kinds.get(loop["name"], loop["kind"]),
            **{end: _moved_end(loop[end], steps.get((end, loop["name"]))) for end in ("first", "second")},
        }
        for loop in constraints["loops"]
    ]
    return etree.tostring(tree, encoding="unicode"), {**constraints, "loops": loops}


def in_plane(constraints: Mapping[str, Any], system: ClosedLoops, q: Array, name: str) -> Mapping[str, Any] | None:
    """Return constraints in which pins with play are closed in the plane (`raff2urdf.loops.play`), with one warning;
    None if there are none.

    Args:
        constraints: the loops.
        system: the same loops.
        q: (nq,) the configuration as written.
        name: the file's, for the warning.
    """
    moves, texts = dict[str, Array](), list[str]()
    for cluster, at in subsystems(system):
        closing = closure.close(cluster, q[at])
        offsets = {} if closing.closed else play(cluster, q[at], closing)
        if offsets:
            names = [loop.name for loop in cluster.loops]
            texts.append(text(names, cluster.ends, offsets))
            moves |= {names[i]: translation(offset) for i, offset in offsets.items()}
    if not moves:
        return None
    warn(f"{name}: " + "\n  ".join(texts))
    loops = [{**loop, "second": _moved_end(loop["second"], moves.get(loop["name"]))} for loop in constraints["loops"]]
    return {**constraints, "loops": loops}


def _move_origin(joint: Any, step: Array) -> None:
    """Change the origin of a URDF's joint by a placement (4, 4) in the joint's axes."""
    placement = origin(joint, "URDF") @ step
    element = joint.find("origin")
    element = etree.SubElement(joint, "origin") if element is None else element
    element.set("xyz", " ".join(map(repr, placement[:3, 3].tolist())))
    element.set("rpy", " ".join(map(repr, roll_pitch_yaw(placement))))


def _moved_end(end: Mapping[str, Any], step: Array | None) -> Mapping[str, Any]:
    return end if step is None else {**end, "placement": (np.array(end["placement"]) @ step).tolist()}


def loop_gaps(system: ClosedLoops, redundancy: NearRedundancy) -> dict[str, tuple[float, float]]:
    """Return by how much loops are open where their clearly independent equations are solved, by name: (m, rad)."""
    gaps, row = {}, 0
    for loop in system.loops:
        pairs = list(zip(redundancy.gaps[row : row + loop.rows].tolist(), loop.components, strict=True))
        lengths, angles = ([gap for gap, word in pairs if len(word) == size] for size in (1, 2))
        gaps[loop.name] = math.hypot(*lengths) * system.length, math.hypot(*angles)
        row += loop.rows
    return gaps


def _size(system: ClosedLoops, twists: Array) -> str:
    """Return the largest length, in mm, and the largest angle, in degrees, of twists (n, 6)."""
    lengths, angles = np.linalg.norm(twists[:, :3], axis=1), np.linalg.norm(twists[:, 3:], axis=1)
    return _millimetres(lengths.max() * system.length, angles.max())


def _millimetres(length: float, angle: float) -> str:
    return f"{1e3 * length:.2g} mm and {math.degrees(angle):.2g} degrees"


def _relaxed(system: ClosedLoops, start: Array) -> list[LoopKind] | None:
    """Return the strongest weaker kinds of joints with which the loops close and are not nearly redundant; None if
    there are none."""
    for weaker in (LoopKind.REVOLUTE, LoopKind.BALL):
        kinds = [weaker if ROWS[kind] > ROWS[weaker] else kind for kind in system.kinds]
        other = system.with_kinds(kinds)
        closing = closure.close(other, start)
        if kinds != system.kinds and closing.closed and near_redundancy(other, closing.q) is None:
            return kinds
    return None


def _healed(
    system: ClosedLoops, redundancy: NearRedundancy, start: Array, names: set[str]
) -> dict[tuple[str, str], Array] | None:
    """Return the smallest twists that make the loops exactly redundant; None if there are none.

    They are those of joints' placements, by ("joint", name), and of loops' ends, by ("first", name) and ("second",
    name).
    """
    model = system.model
    keys = [("joint", str(name)) for name in model.names[1:]] + [("behind", str(name)) for name in model.names[1:]]
    keys += [(end, loop.name) for end in ("first", "second") for loop in system.loops]
    chosen = [i for i, (what, key) in enumerate(keys) if what != "behind" and (what != "joint" or key in names)]
    directions = np.eye(6 * len(keys))[:, np.add.outer(6 * np.array(chosen), np.arange(6)).ravel()]
    change, _ = heal([redundancy], lambda x: [moved(system, directions @ x)], [in_bodies(system, directions)])
    healed = moved(system, directions @ change)
    closing = closure.close_from_afar(healed, start)
    if np.abs(change).max() > LARGEST_CHANGE or not closing.closed or near_redundancy(healed, closing.q) is not None:
        return None
    return dict(zip([keys[i] for i in chosen], change.reshape(-1, 6), strict=True))
