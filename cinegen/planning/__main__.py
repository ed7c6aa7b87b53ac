"""`python -m cinegen.planning` compiles the kernels of planning in advance."""

from cinegen.collision.clearance import prepare_clearance
from cinegen.planning.vortices import prepare_vortices

if __name__ == "__main__":
    prepare_clearance()
    prepare_vortices()
