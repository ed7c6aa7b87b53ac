"""The extended Jacobian of figure 9: the effect of a hybrid planar arm's joints on its tool and on its loop."""

import numpy as np

import cinegen

arm = cinegen.load("planar_hybrid")
J = arm.extended_jacobian(arm.q_home, "tool")
print(J.compact())  # rows that are exactly zero left out: the arm is planar

# Joint speeds that keep the loop closed are the null space of the rows below
loop = J.block(arm.loops[0].name)
_, sigma, vt = np.linalg.svd(loop)
motions = vt[arm.loop_rank :]
print(f"rank of the loop: {arm.loop_rank}, so {len(motions)} motions are left; mobility {arm.mobility}")
print(f"the loop stays closed: {np.abs(loop @ motions.T).max() < 1e-12}")
