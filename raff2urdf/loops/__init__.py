"""Loops and couplings of a robot: residuals, closing them, and their effect on its motion."""
