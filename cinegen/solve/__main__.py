"""`python -m cinegen.solve` compiles all kernels, so that nobody has to wait for that later."""

from cinegen.solve.inverse.kernel import prepare_seek
from cinegen.solve.kernel.tick import prepare_tick
from cinegen.solve.sample.kernel import prepare_sample

prepare_tick()
prepare_seek()
prepare_sample()
