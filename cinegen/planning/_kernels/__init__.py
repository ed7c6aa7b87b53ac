"""Compiled kernels of planning: the vortex field of links."""
