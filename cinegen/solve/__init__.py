"""How a mechanism moves: pulls resolved through an SVD inside what the loops leave, one tick at a time."""

from cinegen.solve.inverse import Reached, reach
from cinegen.solve.pull import Pull
from cinegen.solve.solver import Solver
from cinegen.solve.step import Step, Verdict

__all__ = ["Pull", "Reached", "Solver", "Step", "Verdict", "reach"]
