"""Assembly modes of mechanisms with couplings."""

import re

import pytest
from assembled import nothing_beside, sound, traced

import cinegen


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
