"""`cinegen plan --modes`: to another assembly mode, on the terminal and as JSON."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from cusp_platform import LENGTHS, determinant

from cinegen.cli import main
from cinegen.collision import load_scene


@pytest.fixture
def typed(root, capsys):
    """`typed("any", "--json")`: what the command prints of the cuspidal platform; its errors with `err=True`."""

    def command(modes, *options, code=0, err=False):
        scene = str(root / "robots/scenes/cusp.toml")
        assert main(["plan", scene, *(["--modes", modes] if modes else []), *map(str, options)]) == code
        printed = capsys.readouterr()
        return printed.err if err else printed.out

    return command


@pytest.mark.slow
def test_any_mode_is_reached_without_a_singularity(root, typed):
    found = json.loads(typed("any", "--timeout", 240, "--json"))
    mechanism = load_scene(root / "robots/scenes/cusp.toml").mechanism
    path = [mechanism.configuration(values) for values in found["path"]]
    assert {np.sign(determinant(mechanism, q)) for q in path} == {1.0}
    for q in (path[0], path[-1]):
        assert [q[mechanism.q_index(name)] for name in mechanism.actuated] == pytest.approx(LENGTHS, abs=1e-8)
    change = found["mode_change"]
    assert found["status"] == "reached"
    assert change["modes"] == 6
    assert change["complete"]
    assert 2 <= change["mode"] <= 6
    assert 0.0 < change["sigma_bound"] <= change["sigma"]
    assert change["crossed"] == []


def test_a_path_through_a_singularity_is_reported(typed):
    text = " ".join(typed("2", "--singular", "cross", "--timeout", 4).split())
    assert "to assembly mode 2 with the start's values of the actuated joints" in text
    assert "reached: assembly mode 2 of 6, through" in text
    assert re.search(r"singular after step \d+: sigma [-.e\d]+ of type 2", text)
    assert "1 time limit 0 RRT-Connect, around singularities 2 reached" in text
    assert "the actuated joints lose control: only momentum or gravity" in text


def test_no_path_is_no_proof(typed):
    text = " ".join(typed("2", "--timeout", 2, code=1).split())
    assert "time limit: no path was found in 2 s, which is no proof that there is none" in text
    assert "Try --timeout 12, or --singular cross." in text


@pytest.mark.parametrize(
    ("modes", "options", "message"),
    [
        ("other", [], "--modes other: give any, or the number of a mode"),
        ("0", [], "--modes 0: give any, or the number of a mode"),
        ("7", [], "there is no assembly mode 7: there are 6"),
    ],
)
def test_wrong_options_are_refused(typed, modes, options, message):
    assert message in typed(modes, *options, code=1, err=True)
