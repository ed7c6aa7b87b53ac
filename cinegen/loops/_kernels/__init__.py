"""Kernels of joints and loops: kinematics, residuals, closing loops, following actuated joints.

They allocate nothing and run without the GIL. `cinegen.ik._kernels` adds the tasks. The plain forms are Pinocchio,
`raff2urdf.residual` and `raff2urdf.closure`; the tests compare the two on every robot.
"""
