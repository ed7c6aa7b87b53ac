"""Assembly modes of mechanisms with couplings."""

from __future__ import annotations

import pytest
from assembled import nothing_beside, sound, traced

import cinegen


def test_joints_that_follow_actuated_ones_in_couplings_are_known(robot):
    """Belts change the angles of the actuated joints, not the modes."""
    plain, driven = (cinegen.assembly_modes(robot(name)) for name in ("five_bar", "belt_five_bar"))
    assert (plain.complete, driven.complete) == (True, True)
    assert len(driven) == len(plain) == 2
    for one, other in zip(plain, driven, strict=True):
        here, there = robot("five_bar").placement(one, "tool"), robot("belt_five_bar").placement(other, "tool")
        assert there.isApprox(here, 1e-9)
        assert robot("belt_five_bar").closure(other) <= 1e-12


def test_couplings_of_passive_joints_are_refused_by_name(root, tmp_path):
    text = (root / "robots" / "five_bar.raff").read_text(encoding="utf-8")
    path = tmp_path / "tied.raff"
    tie = 'coupling { name "tie" link 4 link 2 polynomial ( -1 0.001 ) offset 10 }'
    path.write_text(text.replace("constraint { link 5", f"{tie}\n constraint {{ link 5", 1), encoding="utf-8")
    with pytest.raises(cinegen.CinegenError, match="coupling 'tie' does not determine 'joint4' and 'joint2'"):
        cinegen.assembly_modes(cinegen.load(path))


def test_a_passive_joint_follows_another_one(root, tmp_path):
    """A five-bar with one motor, and a gear between the joints of the other arm."""
    text = (root / "robots/five_bar.raff").read_text(encoding="utf-8")
    gear = "coupling { link 4 link 3 ratio -1 offset 137.792189 }\n\n  constraint { link 5 frame 20 }"
    motors = text.replace("actuated 1", "actuated 0").replace("actuated 0", "actuated 1", 1)
    (tmp_path / "geared.raff").write_text(motors.replace("constraint { link 5 frame 20 }", gear), encoding="utf-8")
    geared = cinegen.load(tmp_path / "geared.raff")
    assert (geared.mobility, geared.actuated) == (1, ("joint1",))
    modes = cinegen.assembly_modes(geared)
    traced(modes)
    sound(modes, count=2)
    nothing_beside(modes, ["tool", "link4"], 60)
