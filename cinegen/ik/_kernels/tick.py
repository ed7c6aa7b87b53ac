"""One tick of the resolved-rate solver; see docs/how-it-works.md, "One tick"."""

from __future__ import annotations

from cinegen.ik._kernels.memory import STATUS, SolverMemory
from cinegen.ik._kernels.proposal import is_sure, propose
from cinegen.ik._kernels.record import finish
from cinegen.ik._kernels.steps import set_out
from cinegen.ik._kernels.tasks import read_tasks
from cinegen.ik._kernels.trial import guard, judge_given, try_step
from cinegen.ik.thresholds import BEGIN, DONE, GUARD, JUDGE, PROPOSED, RANK_NEEDED, REFUSED, REJECTED
from cinegen.jit.compiled import compiled, entry
from cinegen.loops._kernels.kinematics import evaluate
from cinegen.loops._kernels.screws import find_screws


@entry
def tick(memory: SolverMemory) -> int:
    """Begin or continue a tick.

    Returns:
        DONE; REJECTED if it is done and its status is REFUSED; or what is needed before the next call: RANK_NEEDED,
        `task_rank` and `level_rank` of the tasks in `signature`; CLEARANCE_NEEDED, `clear_part` of the path to
        `trial`; ERRORS_NEEDED, `given_error` at `trial`, where the joints are evaluated; PROPOSED, nothing: the step
        may be inspected.
    """
    request = _continue(memory)
    return REJECTED if request == DONE and memory.report[STATUS] == REFUSED else request


@compiled
def _continue(memory: SolverMemory) -> int:
    """Begin or continue a tick as `tick` does; REFUSED is DONE, too."""
    if memory.phase == BEGIN:
        if not read_tasks(memory):
            return RANK_NEEDED
        memory.evaluations = 0
        if memory.is_at_q == 0:
            evaluate(memory, memory.q)
            memory.is_at_q = 1
        has_step = propose(memory)
        if memory.is_watched != 0 and memory.screw_rows > 0:
            find_screws(memory)
        if not has_step:
            finish(memory, False, False)
            return DONE
        if memory.is_watched != 0:
            memory.phase = PROPOSED
            return PROPOSED
    if memory.phase == GUARD:
        return guard(memory)
    if memory.phase == JUDGE:
        return judge_given(memory)
    memory.phase = BEGIN
    return _make_step(memory)


@compiled
def _make_step(memory: SolverMemory) -> int:
    """Make the step: without evaluation where it is sure to be accepted, else by trial."""
    set_out(memory)
    if is_sure(memory):
        finish(memory, True, True)
        return DONE
    return try_step(memory)
