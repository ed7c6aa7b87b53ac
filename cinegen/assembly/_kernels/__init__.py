"""Kernels of linkages in complex numbers: their equations, Newton's method and path tracking."""
