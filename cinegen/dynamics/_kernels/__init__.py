"""Kernels of inverse dynamics; the plain form is `cinegen.dynamics.plain`."""
