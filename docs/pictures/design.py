"""Draws the pictures of docs/design.md again: `python docs/pictures/design.py [NAME ...]`."""

from figures import ROBOTS, write

from cinegen.design import calibrate, tolerance
from cinegen.plotting.accuracy import draw_residuals, draw_tolerance


def budget():
    """What contributes to the errors of a delta robot, by the command of the page."""
    sigma = {"link*.d": "0.05mm", "*.alpha": "0.01deg"}
    return draw_tolerance(
        tolerance("delta4", sigma, {"joint2": "0.02mm"}, {"joint1": "0.01deg"}, samples=10_000), name="delta4"
    )


def calibration():
    """The measurements of examples/25_calibrate_a_gough.py."""
    return draw_residuals(calibrate("gough", ROBOTS.parent / "examples/calibrate_a_gough.csv"), name="gough")


FIGURES = {"tolerance_delta4": budget, "calibration_gough": calibration}
"""What draws each of them."""


if __name__ == "__main__":
    write(FIGURES)
