"""RAFF -> MJCF or SDF -> `cinegen.load`: the same mobility, the same motion."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from coupled_robots import CLOSED_TEXTS
from variants import FEWER

import cinegen
from raff2urdf.conversion import convert

ROBOTS = Path(__file__).resolve().parent.parent.parent / "robots"


@pytest.fixture(params=[*sorted(FEWER), *CLOSED_TEXTS])
def original(request, text_file):
    """The RAFF file."""
    if request.param in FEWER:
        return ROBOTS / f"{request.param}.raff"
    return text_file(f"{request.param}.raff", CLOSED_TEXTS[request.param])


@pytest.mark.parametrize("format", ["mjcf", "sdf"])
def test_what_comes_back_is_the_same_mechanism(original, format, tmp_path, recwarn):
    orig = cinegen.load(original)
    (made,) = convert(original, tmp_path / "made", format=format)
    back = cinegen.load(made.file)
    assert back.mobility == orig.mobility
    assert {coupling.name for coupling in back.couplings} == {coupling.name for coupling in orig.couplings}
    assert back.floating == orig.floating
    if not any(loop.kind.name == "PRISMATIC" for loop in orig.loops):
        assert [(loop.name, loop.kind) for loop in back.loops] == [(loop.name, loop.kind) for loop in orig.loops]
    assert set(back.actuated) == set(orig.actuated)
    assert set(orig.joints) <= set(back.joints)
    assert set(orig.nodes) <= set(back.nodes)
    added = set(back.joints) - set(orig.joints)
    assert added or back.length == pytest.approx(orig.length, rel=1e-9)
    assert len(added) == (format == "mjcf") * sum(loop.kind.name == "PRISMATIC" for loop in orig.loops)
    for joint in orig.joints:
        assert back.q_home[back.q_index(joint)] == pytest.approx(orig.q_home[orig.q_index(joint)], abs=1e-9)
        for end in ("lowerPositionLimit", "upperPositionLimit"):
            bound, other = getattr(orig.model, end)[orig.q_index(joint)], getattr(back.model, end)[back.q_index(joint)]
            assert bound == other or bound == pytest.approx(other, abs=1e-9)

    def carried(q, source, target):
        """A configuration of one mechanism in the other."""
        p = target.configuration({joint: q[source.q_index(joint)] for joint in orig.joints})
        if orig.floating:
            base = source.placement(q, "base")
            free = target.placement(target.q_home, "base")
            p = p.copy()
            p[:7] = pin.SE3ToXYZQUAT(pin.XYZQUATToSE3(target.q_home[:7]) * free.inverse() * base)
        return p

    for q in [orig.q_home, *orig.random_closed(4)]:
        p = carried(q, orig, back)
        if added:
            p = back.close(p, locked=orig.joints)
        assert back.closure(p) < 1e-11
        for node in orig.nodes:
            wanted, stands = orig.placement(q, node), back.placement(p, node)
            assert np.abs(wanted.homogeneous - stands.homogeneous).max() < 1e-9
    for p in back.random_closed(4):  # and it can do nothing else
        assert orig.closure(carried(p, back, orig)) < 1e-9
