"""Inverse kinematics: resolved rates by singular values inside what the loops leave, one tick at a time.

Each name is imported when it is first used: `Solver` needs nothing of what lists all solutions.
"""

from typing import TYPE_CHECKING

from raff2urdf.lazy import lazy_names

if TYPE_CHECKING:
    from cinegen.ik.barrier import Range as Range
    from cinegen.ik.batch import Evaluations as Evaluations
    from cinegen.ik.batch import evaluate as evaluate
    from cinegen.ik.forecast import Event as Event
    from cinegen.ik.forecast import EventKind as EventKind
    from cinegen.ik.forecast import Forecast as Forecast
    from cinegen.ik.forecast import LookAhead as LookAhead
    from cinegen.ik.forecast import forecast_motion as forecast_motion
    from cinegen.ik.given_task import Task as Task
    from cinegen.ik.global_ik import IKResult as IKResult
    from cinegen.ik.global_ik import inverse_kinematics as inverse_kinematics
    from cinegen.ik.objectives import LimitMargin as LimitMargin
    from cinegen.ik.objectives import Manipulability as Manipulability
    from cinegen.ik.objectives import Objective as Objective
    from cinegen.ik.objectives import Posture as Posture
    from cinegen.ik.persistent import PersistentSolver as PersistentSolver
    from cinegen.ik.singular_values import LostDoF as LostDoF
    from cinegen.ik.singular_values import UncontrolledDoF as UncontrolledDoF
    from cinegen.ik.solutions import IKError as IKError
    from cinegen.ik.solutions import IKSolutions as IKSolutions
    from cinegen.ik.solver import Solver as Solver
    from cinegen.ik.state import State as State
    from cinegen.ik.step import Status as Status
    from cinegen.ik.step import Step as Step
    from cinegen.ik.task import FrameTask as FrameTask
    from cinegen.ik.tasks.kinds import AxisAlong as AxisAlong
    from cinegen.ik.tasks.kinds import CenterOfMass as CenterOfMass
    from cinegen.ik.tasks.kinds import Damping as Damping
    from cinegen.ik.tasks.kinds import JointEquality as JointEquality
    from cinegen.ik.tasks.kinds import JointValues as JointValues
    from cinegen.ik.tasks.kinds import LookAt as LookAt
    from cinegen.ik.tasks.kinds import PointAtDistance as PointAtDistance
    from cinegen.ik.tasks.kinds import PointInPlane as PointInPlane
    from cinegen.ik.tasks.kinds import PointOnLine as PointOnLine
    from cinegen.ik.tasks.kinds import RelativePose as RelativePose
    from cinegen.ik.tasks.pink_task import PinkTask as PinkTask

__all__, __getattr__, __dir__ = lazy_names(__name__)
