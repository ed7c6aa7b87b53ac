"""Kernels of mechanisms whose parameters change between two evaluations."""
