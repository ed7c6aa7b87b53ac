"""Draws the pictures of docs/design.md again: `python docs/pictures/design.py [NAME ...]`."""

from figures import write

from cinegen.design import tolerance
from cinegen.plotting.tolerance import draw_tolerance


def budget():
    """What contributes to the errors of a delta robot, by the command of the page."""
    sigma = {"link*.d": "0.05mm", "*.alpha": "0.01deg"}
    return draw_tolerance(
        tolerance("delta4", sigma, {"joint2": "0.02mm"}, {"joint1": "0.01deg"}, samples=10_000), name="delta4"
    )


FIGURES = {"tolerance_delta4": budget}
"""What draws each of them."""


if __name__ == "__main__":
    write(FIGURES)
