"""`cinegen plan --modes`: its options, and what is printed of a change of assembly mode."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

from cinegen.errors import CinegenError

if TYPE_CHECKING:
    from cinegen.collision import Scene
    from cinegen.planning import ModeChange

_WIDTH = 100  # columns


def mode_index(modes: str) -> int | None:
    """Return the index of the assembly mode that `--modes` names, counted from 1 there; None for any.

    Args:
        modes: value of `--modes`; empty without the option.

    Raises:
        CinegenError: the mode is neither a number from 1 nor `any`.
    """
    if modes in ("", "any"):
        return None
    if not modes.isdecimal() or int(modes) < 1:
        raise CinegenError(f"--modes {modes}: give any, or the number of a mode as `cinegen modes` lists them")
    return int(modes) - 1


def goal_text(index: int | None, scene: Scene) -> str:
    """Return a text for the goal: a mode, or None for any other one, of a scene."""
    which = "another assembly mode" if index is None else f"assembly mode {index + 1}"
    return f"to {which} with the {'goal' if scene.goal_joints else 'start'}'s values of the actuated joints"


def change_lines(change: ModeChange) -> list[str]:
    """Return lines about the status, the mode that is reached, and the singularities on the path."""
    lines = textwrap.wrap(str(change), _WIDTH, subsequent_indent="  ")
    if change.mode is not None and not change.crossed:
        lines.append(
            f"  sigma      {change.sigma_bound:.3g} at least along the path, of type 2 (estimated between steps)"
        )
    return lines + [f"  singular   after step {hit.segment}: sigma {hit.sigma:.2g} of type 2" for hit in change.crossed]


def change_advice(change: ModeChange, singular: str, seconds: float) -> str:
    """Return what a path through a singularity needs, or what may help to find a path."""
    from cinegen.planning import PlanStatus

    if change.crossed:
        return (
            "At a singularity of type 2 the actuated joints lose control: only momentum or gravity moves a real "
            "mechanism through it."
        )
    if change.plan.status is not PlanStatus.TIME_LIMIT:
        return ""
    return f"Try --timeout {6.0 * seconds:g}" + (", or --singular cross." if singular == "avoid" else ".")


def change_document(change: ModeChange) -> dict[str, Any]:
    """Return the change for JSON: m and rad."""
    from cinegen.typed_json import as_json

    mode, values = None if change.mode is None else change.mode + 1, change.modes.mechanism.values
    crossed = [as_json(hit, "segment", "sigma", joints=values(hit.q)) for hit in change.crossed]
    counts = {"mode": mode, "modes": len(change.modes), "complete": change.modes.complete}
    return as_json(change, "sigma", "sigma_bound", crossed=crossed, **counts)
