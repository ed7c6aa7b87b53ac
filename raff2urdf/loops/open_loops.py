"""Loops that can't be closed, as text: their gaps, and which edit or which kind of joint would close them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.closure import CLOSED, Closing, KindedLoops, close_from_afar, gaps, rank, residuals
from raff2urdf.errors import first_of
from raff2urdf.escape import shell_word
from raff2urdf.loops.near_redundancy import LARGEST_GAP, near_redundancy
from raff2urdf.loops.play import constant_gaps
from raff2urdf.placement import rotation, translation
from raff2urdf.raff.document import LoopKind
from raff2urdf.residual import ROWS, swing

PARALLEL = 0.5
"""Degrees: z axes of hinges that are farther apart are not parallel."""


def shown_gaps(loops: KindedLoops, q: Array) -> list[str]:
    """Return the residual of each loop and coupling at q (nq,) as text: mm and degrees, in the axes of the loop's first
    end."""
    gaps = residuals(loops, q)
    texts = [_shown_gap(kind, part, loops.length) for kind, part in zip(loops.kinds, gaps, strict=False)]
    return texts + [f"{float(np.abs(part).max()):.3g} rad or characteristic lengths" for part in gaps[len(texts) :]]


def _shown_gap(kind: LoopKind, c: Array, length: float) -> str:
    """Return the residual of a loop as text: what is a thousandth of the rest is left out. Of a hinge, along its axis
    and across, and the angle between the axes of its ends."""
    count = 2 if kind is LoopKind.PRISMATIC else 3
    if kind is LoopKind.REVOLUTE:
        parts = [(c[2:3], "mm along its axis"), (c[:2], "mm across it"), (c[3:], "degrees between its axes")]
    else:
        parts = [(c[:count], "mm"), (c[count:], "degrees")]
    shown = []
    for part, unit in parts:
        size, scale = float(np.linalg.norm(part)), 1e3 * length if unit.startswith("mm") else math.degrees(1.0)
        if size > 1e-3 * float(np.abs(c).max()):
            near = int(np.argmax(np.abs(part)))
            is_along = kind is not LoopKind.REVOLUTE and abs(part[near]) > 0.95 * size
            word = f" {'along' if unit == 'mm' else 'about'} {'xyz'[near]}" if is_along else ""
            shown.append(f"{scale * size:.3g} {unit}{word}")
    return " and ".join(shown) or "0 mm"


def why_open(loops: KindedLoops, names: Sequence[str], start: Array, best: Closing, raff: bool) -> str:
    """Return the text of an error: which loops and couplings can't be closed, and what would close them: other axes of
    their ends, or weaker kinds.

    Args:
        loops: that can't be closed.
        names: of all loops and couplings.
        start: (nq,) the configuration as written.
        best: the best attempt.
        raff: whether the file is RAFF, in which the remedy is written then.
    """
    kinds, remaining = loops.kinds, gaps(loops, best.q)
    open_loops = [i for i, gap in enumerate(remaining) if gap > CLOSED]
    jacobian = loops.evaluate(best.q)[1]
    what = "loops and couplings" if len(names) > len(kinds) else "loops"
    words = [kind.name.lower() for kind in kinds] + ["coupling"] * (len(names) - len(kinds))
    shown = shown_gaps(loops, best.q)
    listed = first_of([f"'{names[i]}' ({words[i]}, {shown[i]})" for i in open_loops], 8)
    lines = [
        f"the mechanism can't be closed: these {what} remain open: {listed}",
        f"these are the least gaps found, in the axes of each loop's first end; {jacobian.shape[0]} loop rows of "
        f"rank {rank(jacobian)} on {jacobian.shape[1]} joints",
    ]
    if max(remaining) <= LARGEST_GAP and near_redundancy(loops, best.q, start):
        lines.append("these loops are nearly redundant, since numbers are rounded: `cinegen heal` writes exact ones")
    turns = _turns(loops, open_loops, start)
    apart = [
        f"{' and '.join(loops.ends[i])} "
        + ("point against each other" if angle > 180.0 - PARALLEL else f"are {angle:.4g} degrees apart")
        for i, (angle, *_) in turns.items()
    ]
    edits = _edits(loops, start, {i: turn for i, (*_, turn) in turns.items()})
    if edits is not None:
        as_written = f"the z axes of {', of '.join(apart)} as written. " if apart else ""
        still = "" if apart else "no motion changes these gaps. "
        ends = [f"{_edit(loops.ends[i][1], turns.get(i), offset, raff)}" for i, offset in edits.items()]
        lines.append(f"{as_written}{still}It closes with {'; and '.join(ends)}")
        return "\n  ".join(lines)
    for weaker in (LoopKind.REVOLUTE, LoopKind.BALL):
        changed = [i for i in open_loops if i < len(kinds) and ROWS[kinds[i]] > ROWS[weaker]]
        trial = [weaker if i in changed else kind for i, kind in enumerate(kinds)]
        if changed and close_from_afar(loops.with_kinds(trial), start).closed:
            kind = weaker.name.lower()
            typed = " ".join(f"--loop {shell_word(names[i])}={kind}" for i in changed)
            python = ", ".join(f'{json.dumps(names[i], ensure_ascii=False)}: "{kind}"' for i in changed)
            lines.append(
                f"it closes with {kind} joints there: loops={{{python}}} in Python, {typed} as a command's option"
            )
            if apart and weaker is LoopKind.BALL:
                lines.append(f"but hinges need parallel axes: the z axes of {', of '.join(apart)} as written")
            break
    else:
        if any(i < len(kinds) for i in open_loops):
            lines.append("neither revolute nor ball joints there would close it")
    return "\n  ".join(lines)


def _turns(loops: KindedLoops, open_loops: Sequence[int], start: Array) -> dict[int, tuple[float, float, Array]]:
    """Return for open hinges whose z axes are not parallel as written: the angle between them, and about which axis of
    the second end's x and y it is turned to make them parallel, by its angle from x, degrees; and that rotation."""
    rotations, placed = {}, loops.placements(start)
    for i in open_loops:
        if i < len(loops.kinds) and loops.kinds[i] is LoopKind.REVOLUTE:
            swung, _ = swing(placed[i][2, :3])  # the first end's z axis, seen from the second
            angle = math.degrees(float(np.linalg.norm(swung)))
            if angle > PARALLEL:
                about = math.degrees(math.atan2(swung[1], swung[0]))
                size = float(np.linalg.norm(swung))
                rotations[i] = angle, about, rotation(np.append(swung, 0.0) / size, size)
    return rotations


def _edits(loops: KindedLoops, start: Array, turns: Mapping[int, Array]) -> dict[int, Array] | None:
    """Return the translations (3,) of second ends, m, with which loops close whose second ends are turned by `turns`
    (4, 4) before; None unless they close."""
    steps = {i: (np.eye(4), turn) for i, turn in turns.items()}
    offsets = {i: np.zeros(3) for i in turns}
    turned = loops.with_moved(steps)
    closing = close_from_afar(turned, start)
    if closing.closed:
        return offsets if turns else None
    gaps_left = constant_gaps(turned, closing)
    for i, offset in gaps_left.items():
        steps[i] = np.eye(4), turns.get(i, np.eye(4)) @ translation(offset)
    closes = bool(gaps_left) and close_from_afar(loops.with_moved(steps), start).closed
    return {**offsets, **gaps_left} if closes else None


def _edit(end: str, turn: tuple[float, float, Array] | None, offset: Array, raff: bool) -> str:
    """Return how an end is turned, and then moved by an offset (3,), m, in its own axes."""
    angle, about = (0.0, 0.0) if turn is None else turn[:2]
    x, y, z = (1e3 * offset).tolist()
    is_moved = float(np.abs(offset).max()) > 0.0
    if raff:
        frames = []
        around = f"gamma {about:.8g} " if abs(about) > PARALLEL else ""
        back = f" theta {-about:.8g}" if around else ""
        frames += [f"{around}alpha {angle:.8g}{back}"] if turn is not None else []
        if math.hypot(x, y) > 1e-3 * abs(z):
            to = math.degrees(math.atan2(y, x))
            frames.append(f"gamma {to:.8g} d {math.hypot(x, y):.8g} theta {-to:.8g} r {z:.8g}")
        elif is_moved:
            frames[-1:] = [f"{frames[-1]} r {z:.8g}" if frames else f"r {z:.8g}"]
        listed = " and on that another one, ".join(f"'parameters {{ {frame} }}'" for frame in frames)
        return f"a frame on {end}, {listed}{', lengths in mm' * is_moved}, as that end of the loop"
    axes = {0: "its x", 90: "its y", 180: "its -x", -180: "its -x", -90: "its -y"}
    near = min(axes, key=lambda at: abs(about - at))
    axis = axes[near] if abs(about - near) < PARALLEL else f"an axis {about:.4g} degrees from its x to its y"
    turned = [f"turned by {angle:.4g} degrees about {axis}"] if turn is not None else []
    moved = [f"moved by ({x:.8g}, {y:.8g}, {z:.8g}) mm in its own axes"] if is_moved else []
    return f"the frame of {end} {' and then '.join([*turned, *moved])}"
