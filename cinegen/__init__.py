"""cinegen: kinematics of serial, tree and closed-loop mechanisms. SI units and radians everywhere.

Each name is imported when it is first used: `import cinegen` takes no time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from raff2urdf.lazy import lazy_names

if TYPE_CHECKING:
    from cinegen.assembly import assembly_modes as assembly_modes
    from cinegen.cockpit import Viewer as Viewer
    from cinegen.cockpit import show as show
    from cinegen.dynamics import InverseDynamics as InverseDynamics
    from cinegen.dynamics import Payload as Payload
    from cinegen.dynamics import forces as forces
    from cinegen.errors import CinegenError as CinegenError
    from cinegen.errors import CinegenWarning as CinegenWarning
    from cinegen.errors import ClosureError as ClosureError
    from cinegen.ik import FrameTask as FrameTask
    from cinegen.ik import PersistentSolver as PersistentSolver
    from cinegen.ik import Posture as Posture
    from cinegen.ik import Solver as Solver
    from cinegen.ik import Status as Status
    from cinegen.ik import Step as Step
    from cinegen.ik import Task as Task
    from cinegen.ik import evaluate as evaluate
    from cinegen.ik import forecast_motion as forecast_motion
    from cinegen.ik import inverse_kinematics as inverse_kinematics
    from cinegen.model import ForwardKinematics as ForwardKinematics
    from cinegen.model import Mechanism as Mechanism
    from cinegen.model import load as load
    from cinegen.planning import AvoidingSolver as AvoidingSolver
    from cinegen.planning import plan as plan
    from cinegen.proof import prove as prove
    from cinegen.realtime import Clock as Clock
    from cinegen.singularities import singularity as singularity
    from cinegen.workspace import make_map as make_map
    from raff2urdf.version import __version__ as __version__

__all__, __getattr__, __dir__ = lazy_names(__name__)
