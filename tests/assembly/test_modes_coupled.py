"""Assembly modes of mechanisms with couplings."""

import cmath
import itertools
import math
import re

import numpy as np
import pytest
from assembled import nothing_beside, sound, traced

import cinegen
from cinegen.assembly import ModesError


def test_a_passive_joint_follows_another_one(root):
    """A five-bar with one motor, and a gear between the joints of the other arm."""
    text = (root / "robots/five_bar.raff").read_text(encoding="utf-8")
    gear = "coupling { link 4 link 3 ratio -1 offset 137.792189 }\n\n  constraint { link 5 frame 20 }"
    motors = text.replace("actuated 1", "actuated 0").replace("actuated 0", "actuated 1", 1)
    geared = cinegen.load(motors.replace("constraint { link 5 frame 20 }", gear))
    assert (geared.mobility, geared.actuated) == (1, ("joint1",))
    modes = cinegen.assembly_modes(geared)
    traced(modes)
    sound(modes, count=2)
    nothing_beside(modes, ["tool", "link4"], 60)


FOUR_BAR = """
  link 11 { parameters { theta 50 } type 2 pred 0 }
  link 12 { parameters { theta -26 d 120 } type 2 pred 11 }
  link 13 { parameters { theta 89 d 400 } type 2 actuated 1 pred 0 }
  frame 14 { parameters { d 360 } pred 12 }
  frame 15 { parameters { d 240 } pred 13 }
  constraint { frame 14 frame 15 type 2 }
"""


def test_of_a_mechanism_with_two_clusters_a_motor_of_the_coupled_one_is_redundant(root):
    """A five-bar with two motors whose elbows mirror each other, and a four-bar with one."""
    text = (root / "robots/five_bar.raff").read_text(encoding="utf-8")
    mirrored = "coupling { link 4 link 2 ratio -1 offset 2.481876 }\n" + FOUR_BAR
    both = cinegen.load(text.replace("constraint { link 5", f"{mirrored} constraint {{ link 5", 1))
    assert (both.mobility, both.actuated) == (2, ("joint1", "joint3", "joint13"))
    modes = cinegen.assembly_modes(both)
    assert "with 'joint1' following the other actuated joints" in modes.method
    sound(modes, count=4)


TRAIN = (
    "coupling { link 22 link 21 ratio -0.5 offset 20 }",
    "coupling { link 22 link 13 ratio 2 offset -160 }",  # the joint that follows, theta13, is not the first
    "coupling { link 24 link 13 ratio -1 }",
)


@pytest.mark.parametrize("couplings", list(itertools.permutations(TRAIN)))
def test_joints_follow_a_motor_in_whichever_order_couplings_are_written(couplings):
    """The rocker of a four-bar is at theta13 = 90 - theta21 / 4 degrees; the crank's pin, where two circles meet."""
    wheels = "".join(
        f"link {k} {{ parameters {{ d {100 * k} }} type 2 pred 0 {'actuated 1' * (k == 21)} }}\n" for k in (21, 22, 24)
    )
    text = FOUR_BAR.replace("actuated 1", "") + wheels + "\n".join(couplings)
    geared = cinegen.load(f"RAFF geared robot geared {{ {text} }}")
    assert (geared.mobility, geared.actuated) == (1, ("joint21",))
    modes = cinegen.assembly_modes(geared, [-0.4])
    sound(modes, count=2)
    pin = 0.4 + 0.24 * cmath.exp(1j * (math.pi / 2.0 + 0.1))
    between = math.acos((0.12**2 + abs(pin) ** 2 - 0.36**2) / (2.0 * 0.12 * abs(pin)))
    cranks = sorted(cmath.exp(1j * q[geared.q_index("joint11")]).real for q in modes)
    expected = sorted(math.cos(cmath.phase(pin) + side * between) for side in (-1.0, 1.0))
    assert np.allclose(cranks, expected, rtol=0.0, atol=1e-12)


def test_a_joint_that_has_the_roots_of_a_polynomial_as_values_is_not_called_determined():
    """The slider is at 0.5 theta + 0.01 theta^2 mm: two angles (degrees) of the cam for each of its places."""
    text = """RAFF Cam
    robot cam {
      link 1 { parameters { theta 10 } type 2 pred 0 }
      link 2 { parameters { d 100 r 6 } type 1 pred 0 actuated 1 }
      coupling { link 2 link 1 polynomial ( 0.5 0.01 ) }
    }
    """
    remedy = "'joint2-joint1' does not determine 'joint1'.*: let 'joint1' be actuated"
    with pytest.raises(ModesError, match=remedy) as caught:
        cinegen.assembly_modes(cinegen.load(text))
    assert len(str(caught.value)) < 220
    driven = cinegen.load(text.replace("actuated 1", "").replace("type 2", "type 2 actuated 1"))
    with pytest.raises(ModesError, match="no loops: each value of its joints has one configuration"):
        cinegen.assembly_modes(driven)


def declared(text: str, joints: tuple[int, ...]) -> str:
    """A text whose actuated joints are those of these links."""
    text = text.replace("actuated 1", "")
    for number in joints:
        text = re.sub(rf"(link {number} \{{[^\n]*\n)", r"\1 actuated 1\n", text, count=1)
    return text


def test_the_remedies_for_couplings_of_passive_joints_and_for_too_many_actuated_ones_work(root, tmp_path):
    """Followed one after another, they end where modes are found."""
    text = (root / "robots" / "five_bar.raff").read_text(encoding="utf-8")
    tie = 'coupling { name "tie" link 4 link 2 polynomial ( -1 0.001 ) offset 10 }'
    text = text.replace("constraint { link 5", f"{tie}\n constraint {{ link 5", 1)
    path, how = tmp_path / "tied.raff", "; 'actuated 1' in its link declares an actuated joint"

    def refused(joints: tuple[int, ...]) -> str:
        path.write_text(declared(text, joints), encoding="utf-8")
        with pytest.raises(cinegen.CinegenError) as caught:
            cinegen.assembly_modes(cinegen.load(path))
        return str(caught.value)

    assert f"by a ratio of 1 or -1: let 'joint2' be actuated{how}" in refused((1, 3))
    said = refused((1, 2, 3))
    assert "2 of its actuated joints follow from the others" in said
    passive = re.search(r": let 'joint(\d)' and 'joint(\d)' be passive", said)
    assert passive is not None, said
    left = tuple({1, 2, 3} - {int(number) for number in passive.groups()})
    path.write_text(declared(text, left), encoding="utf-8")
    assert len(cinegen.assembly_modes(cinegen.load(path))) == 2
