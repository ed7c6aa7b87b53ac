"""Numbers in the wrong unit are refused by the geometry of the robot; whatever may be meant is not."""

import numpy as np
import pytest

from cinegen.model.plausible import ImplausibleError, check_lengths, reach


@pytest.mark.parametrize("name", ["arm7", "delta4", "four_bar", "gough"])
def test_no_node_gets_further_than_the_reach_and_the_reach_is_no_wild_guess(robot, name):
    mechanism = robot(name)
    far = max(
        float(np.linalg.norm(mechanism.placement(q, node).translation))
        for q in (mechanism.q_home, *mechanism.structure.samples)
        for node in mechanism.nodes
    )
    assert far <= reach(mechanism) * (1.0 + 1e-9)
    assert reach(mechanism) < 10.0 * far


@pytest.mark.parametrize("name", ["arm7", "delta4", "five_bar", "gough"])
def test_every_point_within_reach_is_accepted_in_m_and_refused_in_mm(robot, name):
    mechanism = robot(name)
    node = mechanism.end
    for q in mechanism.structure.samples:
        point = mechanism.placement(q, node).translation
        check_lengths(mechanism, "x", point.tolist())
        check_lengths(mechanism, "x", (5.0 * point).tolist())  # a map may be larger than the workspace
        if np.abs(point).max() > 0.05 * reach(mechanism):
            with pytest.raises(ImplausibleError, match=r"did you mean .* mm"):
                check_lengths(mechanism, "x", (1000.0 * point).tolist())
