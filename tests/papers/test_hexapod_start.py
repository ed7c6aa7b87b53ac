"""The start system that is shipped can be found again."""

import numpy as np
from hexapod_start import find

from cinegen.hexapod.study import distances, start_system


def test_the_start_system_can_be_found_again():
    again, kept = find(), start_system()
    np.testing.assert_allclose(again.s, kept.s, rtol=1e-12)
    assert distances(again.x, kept.x).min(axis=1).max() < 1e-10
    assert len(again.x) == 40
