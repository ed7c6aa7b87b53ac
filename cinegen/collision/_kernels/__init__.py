"""Kernels of distances: near pairs and their Jacobians, and bounds along a motion."""
