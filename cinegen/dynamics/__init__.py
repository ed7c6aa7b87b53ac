"""Dynamics of a mechanism: what its actuated joints must give, and what its joints must bear."""

from cinegen.dynamics.forces import Forces, forces
from cinegen.dynamics.inverse_dynamics import InverseDynamics
from cinegen.dynamics.loads import Payload
from cinegen.dynamics.reactions import Reaction

__all__ = ["Forces", "InverseDynamics", "Payload", "Reaction", "forces"]
