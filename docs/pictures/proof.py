"""Draws the picture of docs/proof.md again: `python docs/pictures/proof.py`."""

from figures import write

from cinegen import load, prove
from cinegen.plotting.proof import draw_proof


def five_bar():
    """What is proved below the arc that the bars reach, by the command of the page."""
    return draw_proof(prove(load("five_bar"), {"x": (-0.2, 0.2), "y": (0.3, 0.7)}, boxes=600), name="five_bar")


FIGURES = {"proof_five_bar": five_bar}
"""What draws each of them."""


if __name__ == "__main__":
    write(FIGURES)
