"""`python -m cinegen.ik` compiles the kernels of `cinegen.ik` and `cinegen.loops` in advance."""

from numba import types

from cinegen.ik._kernels.batch import measure_all
from cinegen.ik._kernels.local_ik import nearest_start, solve
from cinegen.ik._kernels.memory import BatchMemory, LocalIKMemory, SolverMemory
from cinegen.ik._kernels.tick import tick
from cinegen.jit.compiled import prepare, together
from cinegen.loops._kernels.closure import close_from_trial
from cinegen.loops._kernels.follow import follow
from cinegen.loops._kernels.memory import LoopMemory

with together():
    prepare(close_from_trial, LoopMemory)
    prepare(follow, LoopMemory)
    prepare(tick, SolverMemory)
    prepare(solve, LocalIKMemory)
    prepare(measure_all, BatchMemory)
    prepare(nearest_start, types.float64[:, ::1], types.float64[::1], types.float64[::1])
