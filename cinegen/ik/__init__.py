"""Inverse kinematics: resolved rates by singular values inside what the loops leave, one tick at a time."""

from cinegen.ik.all_solutions import IKError, IKSolutions
from cinegen.ik.batch import Evaluations, evaluate
from cinegen.ik.forecast import Event, EventKind, Forecast
from cinegen.ik.global_ik import IKResult, inverse_kinematics
from cinegen.ik.look_ahead import LookAhead, forecast_motion
from cinegen.ik.objectives import LimitMargin, Manipulability, Objective, Posture, State
from cinegen.ik.persistent import PersistentSolver
from cinegen.ik.singular import LostDoF, UncontrolledDoF
from cinegen.ik.solver import Solver
from cinegen.ik.step import Status, Step
from cinegen.ik.task import FrameTask

__all__ = [
    "Evaluations",
    "Event",
    "EventKind",
    "Forecast",
    "FrameTask",
    "IKError",
    "IKResult",
    "IKSolutions",
    "LimitMargin",
    "LookAhead",
    "LostDoF",
    "Manipulability",
    "Objective",
    "PersistentSolver",
    "Posture",
    "Solver",
    "State",
    "Status",
    "Step",
    "UncontrolledDoF",
    "evaluate",
    "forecast_motion",
    "inverse_kinematics",
]
