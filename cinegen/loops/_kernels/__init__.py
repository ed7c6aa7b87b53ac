"""The arithmetic of loops, compiled: small functions over arrays that exist, without Python, allocation or lock.

Pinocchio computes placements and Jacobians, in Python's hands; all else that closing loops takes is here, and what a
tick adds to that is in `cinegen.ik._kernels`. The same mathematics stands in plain numpy in `raff2urdf.residual` and
`raff2urdf.closure`; the tests hold one against the other on every robot.
"""
