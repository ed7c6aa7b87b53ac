"""`python -m cinegen.ik` compiles all kernels, so that nobody has to wait for that later."""

from cinegen.ik._kernels.batch import prepare_sample
from cinegen.ik._kernels.seek import prepare_seek
from cinegen.ik._kernels.tick import prepare_tick
from cinegen.jit.compiled import together
from cinegen.loops._kernels.newton import prepare_newton
from cinegen.loops._kernels.walk import prepare_walk

with together():
    for prepare in (prepare_newton, prepare_walk, prepare_tick, prepare_seek, prepare_sample):
        prepare()
