"""What a tick asks for, says and remembers, as numbers; and the thresholds of all its decisions."""

DONE, EVALUATE, EVALUATE_HERE, RANK_PLEASE, ACCEPTED = range(5)
BAD_TARGET, REFUSED, AT_LIMIT, SINGULAR, OUT_OF_REACH, FOLLOWING, IDLE, ON_DETOUR = range(8)
BEGIN, JUDGE, ASTRAY = range(3)

CLOSURE = 1e-10
"""A tick whose loops can't be closed to this (rad, characteristic lengths) is refused."""

TIGHT = 1e-12
"""Loops are corrected until their gap is below this (rad, characteristic lengths)."""

STEP_CAP = 0.1
"""rad or lengths in a tick: what the linearisation is good for, even without a velocity limit."""

ERROR_CAP = 0.2
"""rad or lengths: what a tick tries to make good at most; a far target is approached."""

CORRECTION = 0.5
"""Part of the step that closing the loops again may add; more would be another assembly mode."""

ARMIJO = 0.1
"""Part of what a step promises to first order that it must win; the best step wins half of it."""

NEAR_TYPE_2 = 1e-3
"""A singular value of the loops below this is near a type 2 singularity."""

ARRIVED = 1e-6
"""rad or lengths: a pull this near to its target has reached it."""

REST = 1e-7
"""rad or lengths in a tick: slower than this nothing moves."""

HEALTHY = 2e-2
"""Where a row of the loops adds less than this part of the first, singular vectors are used."""

FULL = 1.0 - 1e-9  # part of a velocity limit that is used: rounding never goes beyond it
NOISE = 1e-26  # of `distance`: rounding where a target is reached
TRIES = 10  # times a step that tears is tried shorter
WISHES = 4  # times before that, what redundancy adds is tried shorter; then not at all
IDLE_WISH = 1e-12  # rad or lengths in a tick: of redundancy, less than this is nothing
TRUST_GROWS = 1.25  # from tick to tick, up to 1
LEAST_TRUST = 1e-3
SPARE_SPEED = 0.9  # of a speed limit is for redundancy: what closing the loops adds needs the rest
CORRECTIONS = 12  # evaluations that closing one trial may take
EXACT = 1e-11  # rad or lengths: pulls are corrected with the loops to this
