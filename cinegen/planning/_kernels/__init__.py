"""Compiled kernels of planning: the vortex field of links, and contours of elliptical potentials."""
