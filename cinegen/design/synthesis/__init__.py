"""Synthesis: dimensions with which a mechanism does a task best."""

from cinegen.design.synthesis.linkage_result import LinkageSynthesis
from cinegen.design.synthesis.linkages import PrecisionProblem
from cinegen.design.synthesis.problem import SynthesisProblem
from cinegen.design.synthesis.quantities import QUANTITIES
from cinegen.design.synthesis.region import Reach
from cinegen.design.synthesis.result import Check, FrontPoint, Start, Synthesis
from cinegen.design.synthesis.search import synthesize
from cinegen.design.synthesis.task import DesignObjective, Precision, SynthesisTask
from cinegen.design.synthesis.task_file import load_task, task_of

__all__ = [
    "QUANTITIES",
    "Check",
    "DesignObjective",
    "FrontPoint",
    "LinkageSynthesis",
    "Precision",
    "PrecisionProblem",
    "Reach",
    "Start",
    "Synthesis",
    "SynthesisProblem",
    "SynthesisTask",
    "load_task",
    "synthesize",
    "task_of",
]
