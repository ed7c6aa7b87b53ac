"""cinegen: drive, study and show any mechanism, serial, tree or closed. SI units and radians everywhere."""

from cinegen.errors import CinegenError, CinegenWarning, ClosureError
from cinegen.model import Mechanism, load
from cinegen.solve import Clock, PersistentSolver, Pull, Solver, Step, Verdict, evaluate, reach

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
]
