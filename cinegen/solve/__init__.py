"""How a mechanism moves: pulls resolved through an SVD inside what the loops leave, one tick at a time."""

from cinegen.solve.clock import Clock, ClockError, Tick
from cinegen.solve.forecast import Event, EventKind, Forecast
from cinegen.solve.inverse import Reached, reach
from cinegen.solve.objectives import LimitMargin, Manipulability, Objective, Posture, State
from cinegen.solve.persistent import PersistentSolver
from cinegen.solve.pull import Pull
from cinegen.solve.sample import Evaluations, evaluate
from cinegen.solve.singular import Gained, Lost
from cinegen.solve.solver import Solver
from cinegen.solve.step import Step, Verdict

__all__ = [
    "Clock",
    "ClockError",
    "Evaluations",
    "Event",
    "EventKind",
    "Forecast",
    "Gained",
    "LimitMargin",
    "Lost",
    "Manipulability",
    "Objective",
    "PersistentSolver",
    "Posture",
    "Pull",
    "Reached",
    "Solver",
    "State",
    "Step",
    "Tick",
    "Verdict",
    "evaluate",
    "reach",
]
