"""Tolerances that several packages share, one meaning each. Lengths of loops are in characteristic lengths.

A configuration is *closed* if no residual of its loops exceeds `CLOSURE`: everything that takes a configuration accepts
it then. Everything that closes loops continues to `CLOSED`, and fails (`Mechanism.close`, `ForwardKinematics`) or is
content with `CLOSURE` (the solver, whose step would else be refused for rounding).
"""

from cinegen.loops.thresholds import AT_LIMIT as AT_LIMIT
from cinegen.loops.thresholds import AT_SINGULAR as AT_SINGULAR
from cinegen.loops.thresholds import CLOSURE as CLOSURE
from cinegen.loops.thresholds import NEAR_SINGULAR as NEAR_SINGULAR
from raff2urdf.closure import CLOSED as CLOSED
