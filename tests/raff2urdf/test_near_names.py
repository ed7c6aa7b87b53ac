"""Names that errors propose are near to what was written: others are listed."""

import pytest

from raff2urdf.errors import did_you_mean, near_names

JOINTS = [f"joint{number}" for number in range(1, 7)]


@pytest.mark.parametrize(("word", "known", "near"), [
    ("jont1", JOINTS, ["joint1"]),
    ("alpah", ["alpha"] * 2, ["alpha"]),
    ("shoulder_pan", ["shoulder_pan_joint", "elbow_joint"], ["shoulder_pan_joint"]),
    ("sigma_9", ["sigma_1", "sigma_2", "margin"], ["sigma_1", "sigma_2"]),
    ("cvs", ["csv", "npz"], ["csv"]),
    ("rad", ["rod", "base"], ["rod"]),
    ("joint9", JOINTS, []),  # all six are as near
    ("elbow", ["yellow", "bow"], []),
    ("gripper", ["rigid", "ripple"], []),
    ("", JOINTS, []),
])  # fmt: skip
def test_near_names_are_proposed(word, known, near):
    assert near_names(word, known) == near


def test_what_is_far_is_listed_and_what_is_similar_first():
    known = [f"{node}.{word}" for node in ("base", "tool", *JOINTS) for word in ("theta", "d")]
    assert did_you_mean("joint9.d", known).startswith(f" (known: {', '.join(f'{node}.d' for node in JOINTS)}, ")
    assert did_you_mean("?", known).startswith(" (known: base.theta, base.d, tool.theta, ")
    assert did_you_mean("joint9", JOINTS).startswith(" (known: joint1, joint2")
    assert did_you_mean("sigma_9", ["sigma_1", "sigma_2"]) == ": did you mean 'sigma_1' or 'sigma_2'?"
