"""Kernels of a tick, of local inverse kinematics and of batches. They allocate nothing and run without the GIL.

The plain forms are `tests/ik/reference_tick.py`, `cinegen.ik.task` and `raff2urdf.residual`; the tests compare the two
on every robot.
"""
