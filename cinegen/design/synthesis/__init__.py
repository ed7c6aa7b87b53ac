"""Synthesis: dimensions with which a mechanism does a task best."""

from cinegen.design.synthesis.linkages import LinkageSynthesis, PrecisionProblem
from cinegen.design.synthesis.problem import Check, Start, Synthesis, SynthesisProblem, synthesize
from cinegen.design.synthesis.task import DesignObjective, Precision, Reach, Task, load_task, task_of

__all__ = [
    "Check",
    "DesignObjective",
    "LinkageSynthesis",
    "Precision",
    "PrecisionProblem",
    "Reach",
    "Start",
    "Synthesis",
    "SynthesisProblem",
    "Task",
    "load_task",
    "synthesize",
    "task_of",
]
