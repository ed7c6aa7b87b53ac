"""`python -m cinegen.solve.kernel` compiles the kernels, so that nobody has to wait for that later."""

from cinegen.solve.kernel.tick import prepare

prepare()
