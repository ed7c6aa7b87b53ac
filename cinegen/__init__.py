"""cinegen: drive, study and show any mechanism, serial, tree or closed. SI units and radians everywhere."""

from cinegen.errors import CinegenError, CinegenWarning, ClosureError
from cinegen.model import Mechanism, load
from cinegen.solve import Pull, Reached, Solver, Step, Verdict, reach

__all__ = [
    "CinegenError",
    "CinegenWarning",
    "ClosureError",
    "Mechanism",
    "Pull",
    "Reached",
    "Solver",
    "Step",
    "Verdict",
    "load",
    "reach",
]
