"""RAFF -> MJCF or SDF -> `cinegen.load`: the same mobility, the same motion."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from coupled_robots import CLOSED_TEXTS
from variants import FEWER

import cinegen
import raff2urdf
from raff2urdf.conversion import convert

ROBOTS = Path(__file__).resolve().parent.parent.parent / "robots"
FILES = [
    (ROBOTS / f"{name}.raff", robot.name)
    for name in sorted(FEWER)
    for robot in raff2urdf.load(ROBOTS / f"{name}.raff").robots
]


@pytest.fixture(params=[*(f"{path.stem}:{name}" for path, name in FILES), *CLOSED_TEXTS])
def original(request, tmp_path_factory):
    """The RAFF file, and which of its robots."""
    if request.param not in CLOSED_TEXTS:
        return next(one for one in FILES if f"{one[0].stem}:{one[1]}" == request.param)
    path = tmp_path_factory.mktemp("raff") / f"{request.param}.raff"
    path.write_text(CLOSED_TEXTS[request.param])
    return path, None


@pytest.mark.parametrize("format", ["mjcf", "sdf"])
def test_what_comes_back_is_the_same_mechanism(original, format, tmp_path, recwarn):
    path, name = original
    there = cinegen.load(path, name)
    made = [one for one in convert(path, tmp_path, format=format) if one.robot == there.name]
    back = cinegen.load(made[0].file)
    assert back.mobility == there.mobility
    assert {coupling.name for coupling in back.couplings} == {coupling.name for coupling in there.couplings}
    assert back.floating == there.floating
    if not any(loop.kind.name == "PRISMATIC" for loop in there.loops):
        assert [(loop.name, loop.kind) for loop in back.loops] == [(loop.name, loop.kind) for loop in there.loops]
    assert set(back.actuated) == set(there.actuated)
    assert set(there.joints) <= set(back.joints)
    assert set(there.nodes) <= set(back.nodes)
    added = set(back.joints) - set(there.joints)
    assert added or back.length == pytest.approx(there.length, rel=1e-9)
    assert len(added) == (format == "mjcf") * sum(loop.kind.name == "PRISMATIC" for loop in there.loops)
    for joint in there.joints:
        assert back.q_home[back.q_index(joint)] == pytest.approx(there.q_home[there.q_index(joint)], abs=1e-9)
        for end in ("lowerPositionLimit", "upperPositionLimit"):
            own, other = getattr(there.model, end)[there.q_index(joint)], getattr(back.model, end)[back.q_index(joint)]
            assert own == other or own == pytest.approx(other, abs=1e-9)

    def carried(q, source, target):
        """A configuration of one mechanism in the other."""
        p = target.configuration({joint: q[source.q_index(joint)] for joint in there.joints})
        if there.floating:
            base = source.placement(q, "base")
            free = target.placement(target.q_home, "base")
            p = p.copy()
            p[:7] = pin.SE3ToXYZQUAT(pin.XYZQUATToSE3(target.q_home[:7]) * free.inverse() * base)
        return p

    for q in [there.q_home, *there.random_closed(4)]:
        p = carried(q, there, back)
        if added:
            p = back.close(p, locked=there.joints)
        assert back.closure(p) < 1e-11
        for node in there.nodes:
            wanted, stands = there.placement(q, node), back.placement(p, node)
            assert np.abs(wanted.homogeneous - stands.homogeneous).max() < 1e-9
    for p in back.random_closed(4):  # and it can do nothing else
        assert there.closure(carried(p, back, there)) < 1e-9
