"""`python -m cinegen.solve` compiles all kernels, so that nobody has to wait for that later."""

from cinegen.kernel.compiled import together
from cinegen.kernel.newton import prepare_newton
from cinegen.kernel.walk import prepare_walk
from cinegen.solve.inverse.kernel import prepare_seek
from cinegen.solve.kernel.tick import prepare_tick
from cinegen.solve.sample.kernel import prepare_sample

with together():
    for prepare in (prepare_newton, prepare_walk, prepare_tick, prepare_seek, prepare_sample):
        prepare()
