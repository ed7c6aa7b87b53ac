"""`draw_proof`: a proof as a picture: what is proved, refuted and undecided of a region."""

from __future__ import annotations

import math

from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from cinegen.plotting.sheet import BLUE, FAINT, INK, VERMILION, finish, label, sheet
from cinegen.proof import Proof

COLOURS = {"proved": BLUE, "refuted": VERMILION, "undecided": "#c9ced4"}
_WIDTH = 0.7  # of an edge of a box, points


def draw_proof(proof: Proof, size: float = 6.0, name: str = "") -> Figure:
    """Draw the boxes over the first two coordinates of a proof's region, the others at their middle; in m and degrees.

    Args:
        proof: of `cinegen.prove`.
        size: width, inches.
        name: of the robot, in the title.
    """
    names, ends = list(proof.region), [list(range_) for range_ in proof.region.values()]
    scales = [math.degrees(1.0) if coordinate.startswith("r") else 1.0 for coordinate in names]
    others = [
        f"{coordinate} = {0.5 * (low + high) * scale:.4g}{_unit(coordinate)}"
        for coordinate, (low, high), scale in list(zip(names, ends, scales, strict=True))[2:]
    ]
    text = "; ".join([proof.message, ", ".join(others)] if others else [proof.message])
    low, high = ([end * scale for end, scale in zip(part, scales, strict=True)] for part in zip(*ends, strict=True))
    is_flat = len(names) == 1
    shape = 0.25 if is_flat else (high[1] - low[1]) / (high[0] - low[0]) if scales[0] == scales[1] else 0.8
    figure, body = sheet(size, size * min(max(shape, 0.25), 1.6) + 0.6, f"{name}: proof" if name else "proof", text)
    axes = body.subplots()
    for box, status in proof.cells():
        if status in COLOURS and all(
            a <= 0.5 * (b + c) < d for (a, d), (b, c) in list(zip(box, ends, strict=True))[2:]
        ):
            x, y = box[0] * scales[0], (0.0, 1.0) if is_flat else box[1] * scales[1]
            axes.add_patch(
                Rectangle(
                    (x[0], y[0]), x[1] - x[0], y[1] - y[0], facecolor=COLOURS[status], edgecolor="white", lw=_WIDTH
                )
            )
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(*((0.0, 1.0) if is_flat else (low[1], high[1])))
    if not is_flat and scales[0] == scales[1]:
        axes.set_aspect("equal")
    if is_flat:
        axes.set_yticks([])
    label(axes, f"{names[0]} ({_unit(names[0]).strip()})", "" if is_flat else f"{names[1]} ({_unit(names[1]).strip()})")
    axes.grid(color=FAINT, alpha=0.25)
    keys = [
        Patch(facecolor=colour, label=f"{key} {100.0 * getattr(proof, key):.4g} %") for key, colour in COLOURS.items()
    ]
    body.legend(handles=keys, loc="outside lower left", ncols=3, frameon=False, fontsize="small", labelcolor=INK)
    return finish(figure)


def _unit(name: str) -> str:
    return "°" if name.startswith("r") else " m"
