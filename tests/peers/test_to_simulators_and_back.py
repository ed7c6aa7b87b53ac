"""RAFF -> MJCF or SDF -> `cinegen.load`: the same mobility, the same motion."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
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

MORE = {
    "coupled": """RAFF Coupled
robot coupled {
  base { parameters { theta 10 alpha 20 } }
  link 1 { parameters { theta 40 } type 2 pred 0 limits { -170 170 } }
  link 2 { parameters { theta 20 d 300 r 50 } type 2 pred 1 }
  link 3 { parameters { theta 60 d 200 r 25 } type 1 pred 2 }
  link 4 { parameters { theta 10 alpha 90 d 100 } type 2 pred 3 }
  link 5 { parameters { theta 30 alpha 90 d 100 } type 2 pred 4 }
  link 6 { parameters { theta -15 d 100 } type 2 pred 5 }
  coupling { link 2 link 1 ratio -0.5 offset 40 }
  coupling { link 3 link 2 lead 20 offset 10 }
  coupling { name "wrist" link 4 link 5 ratio 0.5 link 6 ratio -0.25 offset 3 }
}""",
    "curved": """RAFF Curved
robot curved {
  base { }
  link 1 { parameters { theta 40 } type 2 pred 0 limits { -170 170 } }
  link 2 { parameters { theta 20 d 300 } type 2 pred 1 }
  link 3 { parameters { theta 60 d 200 } type 2 pred 2 }
  link 4 { parameters { theta -26 d 120 } type 2 pred 0 }
  frame 5 { parameters { d 100 } pred 3 }
  frame 6 { parameters { d 360 } pred 4 }
  link 7 { parameters { r 20 alpha 90 } type 1 pred 4 }
  link 8 { parameters { theta 20 alpha 90 } type 2 pred 7 }
  constraint { frame 5 frame 6 type 2 }
  coupling { link 7 link 8 polynomial ( 1.5 0.02 -0.001 ) offset 20 }
  coupling { name "cam" link 8 link 1 polynomial ( 0 0.01 ) link 4 ratio 0.5 }
}""",
    "floating": """RAFF Floating
sensor 1 { port "/dev/tty" }
robot floating {
  base { parameters { r 500 alpha 30 } }
  link 1 { parameters { theta 40 r 100 } type 2 pred 0 limits { -170 170 } velocity 90 }
  link 2 { parameters { r 300 alpha 90 } type 1 pred 1 limits { 0 500 } }
  constraint { base sensor ( 0 1 ) }
}""",
}


@pytest.fixture(params=[*(f"{path.stem}:{name}" for path, name in FILES), *MORE])
def original(request, tmp_path_factory):
    """The RAFF file, and which of its robots."""
    if request.param not in MORE:
        return next(one for one in FILES if f"{one[0].stem}:{one[1]}" == request.param)
    path = tmp_path_factory.mktemp("raff") / f"{request.param}.raff"
    path.write_text(MORE[request.param])
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
