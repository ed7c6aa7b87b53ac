"""Requests, statuses and phases of a tick as numbers, and its thresholds."""

DONE, RANK_NEEDED, CLEARANCE_NEEDED, PROPOSED, REJECTED, ERRORS_NEEDED = range(6)
"""Requests of a tick."""

BAD_TARGET, REFUSED, AT_LIMIT, SINGULAR, OUT_OF_REACH, FOLLOWING, IDLE, DETOUR, BARRED = range(9)
NO_FREEDOM = 11
"""Statuses of a tick, in the order of `cinegen.ik.Status`."""

BEGIN, GUARD, JUDGE = 0, 1, 6
"""Phases of a tick: besides PROPOSED, it begins, or waits for the clearance or the errors of its trial."""

RESTING = 6.25e-4
"""NEAR_SINGULAR^2 / 4: least damping of a squared singular value of 0.

With much less, a robot at its limits would make large null-space motions for a negligible gain.
"""

STEP_CAP = 0.1
"""Largest step of a joint in a tick, rad or lengths, even without a velocity limit: range of the linearisation."""

ERROR_CAP = 0.2
"""Largest error that a tick corrects, rad or lengths; a distant target is approached at a limited rate."""

ARMIJO = 0.1
"""Fraction of the first-order reduction that a step must reach; the best step reaches half of it."""

ROTATION = 1e-3
"""Largest error of the products of a rotation's columns: a target with larger ones has no orientation."""

ARRIVED = 1e-6
"""A task this near to its target has reached it, rad or lengths."""

REST = 1e-7
"""Joints that move less in a tick are at rest, rad or lengths (times the tick's gain)."""

FULL = 1.0 - 1e-9  # usable fraction of a velocity limit: rounding never exceeds it
NOISE = 1e-26  # of the cost of the tasks: rounding at a reached target
TRIES = 10  # number of times that a step is shortened
SECONDARY_TRIES = 4  # number of times that the secondary step is shortened before; then it is left out
SLOWER_TRIES = 4  # number of times that braking is halved where the loops don't close after it
LEVEL_TRIES = 6  # number of times that a level's part of the step is halved; then it is left out
BRAKINGS = 3  # number of times that braking is scaled to what closing the loops leaves of it
IDLE_SECONDARY = 1e-12  # rad or lengths in a tick: a shorter secondary step is left out
SCALE_GROWS = 1.25  # from tick to tick, up to 1
FAR_APART = 0.1  # ratio of weights: then the second-order errors of heavy tasks would outweigh light ones
LEAST_SCALE = 1e-3
SPARE_SPEED = 0.9  # fraction of a velocity limit for redundancy: closing the loops needs the remainder
CORRECTIONS = 12  # largest number of corrections of one trial
EXACT = 1e-11  # rad or lengths: tasks are corrected with the loops to this
