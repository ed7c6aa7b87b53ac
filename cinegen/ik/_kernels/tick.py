"""One tick as a conversation: `tick` says what it needs next, and is called again when that is there.

Pinocchio computes placements and Jacobians, in Python's hands; all else is here. A tick begins with the Jacobians of
where the robot stands, proposes a configuration to be evaluated, corrects it until all loops are closed, judges it, and
either accepts or tries a shorter step. What it does is described in docs/how-it-works.md, "One tick".
"""

from __future__ import annotations

from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.aims import holding
from cinegen.ik._kernels.proposal import is_sure, propose
from cinegen.ik._kernels.record import finish
from cinegen.ik._kernels.trial import guard, judge, set_out
from cinegen.ik.thresholds import (
    ACCEPTED,
    ASTRAY,
    BEGIN,
    DONE,
    EVALUATE,
    EVALUATE_HERE,
    GUARD,
    JUDGE,
    RANK_PLEASE,
)
from cinegen.jit.compiled import TABLE, Table, entry, prepare


@entry
def tick(t: Table) -> int:
    """Goes on with a tick.

    Returns:
        DONE, or what is needed before the next call: EVALUATE, Pinocchio's Jacobians at `trial`; EVALUATE_HERE, those
        at `q`; RANK_PLEASE, the generic rank of the pulls in `signature`; CLEAR_PLEASE, the part of the way to
        `trial` that barriers allow. Or ACCEPTED: done, and Pinocchio's Jacobians at the new q are needed before the
        next tick.
    """
    if t[m.PHASE] == JUDGE:
        return judge(t)
    if t[m.PHASE] == GUARD:
        return guard(t)
    if t[m.PHASE] == ASTRAY:
        t[m.PHASE] = BEGIN
        return EVALUATE_HERE
    if not holding(t):
        return RANK_PLEASE
    if not propose(t):
        finish(t, False)
        return DONE
    set_out(t)
    if is_sure(t):
        finish(t, True)
        return ACCEPTED
    t[m.PHASE] = JUDGE
    return EVALUATE


def prepare_tick() -> None:
    """Compiles it, or loads it from disk: 15 to 30 seconds, or a quarter of one."""
    prepare(tick, TABLE)
