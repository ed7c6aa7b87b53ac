"""The model of a robot: a Pinocchio model with its loops, nodes, limits and actuated joints."""

from cinegen.loops.closed_loops import LoopConstraint
from cinegen.model.forward import ForwardKinematics
from cinegen.model.jacobian import ExtendedJacobian
from cinegen.model.load import load
from cinegen.model.mechanism import Mechanism

__all__ = ["ExtendedJacobian", "ForwardKinematics", "LoopConstraint", "Mechanism", "load"]
