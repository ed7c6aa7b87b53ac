"""`python -m cinegen.planning` compiles its kernels, so that nobody has to wait for that later."""

from cinegen.collision.clearance import prepare_clearance
from cinegen.planning._kernels.superquadric import prepare_contours

if __name__ == "__main__":
    prepare_clearance()
    prepare_contours()
