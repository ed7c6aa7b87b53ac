"""Dynamics of a mechanism: what its actuated joints must give, and what its joints must bear."""

from cinegen.dynamics.inverse_dynamics import InverseDynamics
from cinegen.dynamics.payload import Payload

__all__ = ["InverseDynamics", "Payload"]
