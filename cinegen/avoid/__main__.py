"""`python -m cinegen.avoid` compiles its kernels, so that nobody has to wait for that later."""

from cinegen.avoid.clearance import prepare_clearance
from cinegen.avoid.kernel.superquadric import prepare_contours

if __name__ == "__main__":
    prepare_clearance()
    prepare_contours()
