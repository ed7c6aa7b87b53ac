"""Load a robot with closed loops, analyse its loops, and close it again after a random motion of its joints."""

import numpy as np

import cinegen

delta = cinegen.load("delta4")
print(delta)
print(f"actuated joints: {', '.join(delta.actuated)}")
print(f"open as written: {delta.gap_as_written:.1e}, at home: {delta.closure(delta.q_home) < 1e-12 and 'closed'}")

# A configuration is a plain array, one number for each joint. These loops are open:
torn = delta.q_home + np.random.default_rng(1).normal(scale=0.1, size=delta.q_home.shape)
print(f"torn: {delta.closure(torn):.3f} (rad, or parts of {delta.length:.2f} m)")

# The nearest configuration with all loops closed, the rounding of a double apart:
q = delta.close(torn)
print(f"closed again: {delta.closure(q) < 1e-12}, after moving joints by {np.abs(q - torn).max():.3f} rad at most")
