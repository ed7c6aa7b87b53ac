"""What a tick asks for and reports, as numbers; and the thresholds of all its decisions."""

DONE, RANK_NEEDED, CLEARANCE_NEEDED, PROPOSED = range(4)
"""Requests of a tick."""

BAD_TARGET, REFUSED, AT_LIMIT, SINGULAR, OUT_OF_REACH, FOLLOWING, IDLE, DETOUR, BARRED = range(9)
"""Statuses of a tick, in the order of `cinegen.ik.Status`."""

BEGIN, GUARD = 0, 1
"""Phases of a tick: besides PROPOSED, it begins, or waits for the clearance of its trial."""

NEAR = 0.05
"""A singular value (dimensionless) below this is near a singularity: damping sets in, smoothly."""

RESTING = 6.25e-4
"""NEAR^2 / 4: what is added to a squared singular value of 0, at least.

Much less, and a robot at its limits would swing through all its redundancy to win next to nothing.
"""

STEP_CAP = 0.1
"""rad or lengths in a tick: what the linearisation is good for, even without a velocity limit."""

ERROR_CAP = 0.2
"""rad or lengths: what a tick tries to make good at most; a far target is approached."""

ARMIJO = 0.1
"""Part of what a step promises to first order that it must win; the best step wins half of it."""

NEAR_TYPE_2 = 1e-3
"""A singular value of the loops below this is near a type 2 singularity."""

ARRIVED = 1e-6
"""rad or lengths: a task this near to its target has reached it."""

REST = 1e-7
"""rad or lengths in a tick that makes good all it can (times its gain else): slower than this nothing moves."""

FULL = 1.0 - 1e-9  # part of a velocity limit that is used: rounding never goes beyond it
NOISE = 1e-26  # of `distance`: rounding where a target is reached
TRIES = 10  # times a step that tears is tried shorter
SECONDARY_TRIES = 4  # times before that, the secondary step is tried shorter; then not at all
IDLE_SECONDARY = 1e-12  # rad or lengths in a tick: a secondary step shorter than this is left out
SCALE_GROWS = 1.25  # from tick to tick, up to 1
LEAST_SCALE = 1e-3
SPARE_SPEED = 0.9  # of a speed limit is for redundancy: what closing the loops adds needs the rest
CORRECTIONS = 12  # evaluations that closing one trial may take
EXACT = 1e-11  # rad or lengths: tasks are corrected with the loops to this
