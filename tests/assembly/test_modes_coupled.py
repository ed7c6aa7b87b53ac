"""Assembly modes of mechanisms with couplings."""

from __future__ import annotations

import pytest

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
