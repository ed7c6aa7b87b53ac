"""cinegen: drive, study and show any mechanism, serial, tree or closed. SI units and radians everywhere."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

from cinegen.errors import CinegenError, CinegenWarning, ClosureError
from cinegen.ik import PersistentSolver, Pull, Solver, Status, Step, evaluate, inverse_kinematics
from cinegen.model import Mechanism, load
from cinegen.realtime import Clock

if TYPE_CHECKING:
    from cinegen.assembly import assembly_modes
    from cinegen.cockpit import show
    from cinegen.planning import plan
    from cinegen.singularities import singularity
    from cinegen.workspace import make_map

try:
    __version__ = version("cinegen")
except PackageNotFoundError:  # run from its sources
    __version__ = "0+unknown"

__all__ = [
    "CinegenError",
    "CinegenWarning",
    "Clock",
    "ClosureError",
    "Mechanism",
    "PersistentSolver",
    "Pull",
    "Solver",
    "Status",
    "Step",
    "assembly_modes",
    "evaluate",
    "inverse_kinematics",
    "load",
    "make_map",
    "plan",
    "show",
    "singularity",
]

_PACKAGES = {
    "assembly_modes": "cinegen.assembly",
    "make_map": "cinegen.workspace",
    "plan": "cinegen.planning",
    "show": "cinegen.cockpit",
    "singularity": "cinegen.singularities",
}


def __getattr__(name: str) -> object:
    """Import what is slow to import when somebody asks for it."""
    if name in _PACKAGES:
        return getattr(import_module(_PACKAGES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """Return all names, also those that are not imported yet."""
    return sorted({*globals(), *__all__})
