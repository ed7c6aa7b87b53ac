"""What a robot is: a Pinocchio model with its loops, nodes, limits and actuators."""

from cinegen.loops.closed_loops import Loop
from cinegen.model.forward import ForwardKinematics
from cinegen.model.jacobian import ExtendedJacobian
from cinegen.model.load import load
from cinegen.model.mechanism import Mechanism

__all__ = ["ExtendedJacobian", "ForwardKinematics", "Loop", "Mechanism", "load"]
