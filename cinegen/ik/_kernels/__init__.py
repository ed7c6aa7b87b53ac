"""The tick's arithmetic, compiled: small functions over arrays that exist already, without Python, allocation or lock.

The same mathematics stands in plain numpy in `tests/ik/reference_tick.py`, `cinegen.ik.task` and `raff2urdf.residual`;
the tests hold one against the other on every robot.
"""
