"""cinegen: drive, study and show any mechanism, serial, tree or closed. SI units and radians everywhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cinegen.errors import CinegenError, CinegenWarning, ClosureError
from cinegen.model import Mechanism, load
from cinegen.solve import Clock, PersistentSolver, Pull, Solver, Step, Verdict, evaluate, reach

if TYPE_CHECKING:
    from cinegen.cockpit import show

__all__ = [
    "CinegenError",
    "CinegenWarning",
    "Clock",
    "ClosureError",
    "Mechanism",
    "PersistentSolver",
    "Pull",
    "Solver",
    "Step",
    "Verdict",
    "evaluate",
    "load",
    "reach",
    "show",
]


def __getattr__(name: str) -> object:
    """The page's server is loaded when somebody wants to see something."""
    if name == "show":
        from cinegen.cockpit import show

        return show
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
