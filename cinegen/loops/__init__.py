"""Closed loops: their residuals and Jacobians, and how they are closed; in numpy and compiled."""
