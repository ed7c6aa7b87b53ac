"""`cinegen heal`: a file whose numbers make its loops exact, and nothing else in it changed."""

import math

import pytest
from urdf_text import UrdfJoint, urdf_text

import cinegen
from cinegen.cli import main
from raff2urdf.cli import main as raff2urdf

TILTED = 0.003  # degrees


@pytest.fixture
def tilted(root, text_file):
    """A four-bar whose coupler's axis is tilted by a little."""
    text = (root / "robots/four_bar.raff").read_text(encoding="utf-8")
    path = text_file("tilted.raff", text.replace("d 120.0 }", f"d 120.0 alpha {TILTED} }}"))
    return path


def test_each_number_that_changes_is_listed(tilted, tmp_path, typed, capsys):
    out = tmp_path / "healed.raff"
    with pytest.warns(cinegen.CinegenWarning, match="nearly redundant"):
        cinegen.load(tilted)
    said = typed("heal", tilted, out).out
    assert f"tilted.raff:27: link 2 alpha: {TILTED} -> 0.0 (-0.003 degrees)" in said
    healed = cinegen.load(out)  # without a warning
    assert healed.mobility == 1
    assert healed.closure(healed.q_home) < 1e-12
    assert raff2urdf(["--check", str(tilted)]) == 0
    said = capsys.readouterr().err
    assert said.startswith("warning: ")
    assert "healed: placements changed by up to" in said
    # what fails by rounding names this command, which helps
    assert raff2urdf(["--check", "--exact", str(tilted)]) == 1
    assert "`cinegen heal` writes exact ones" in capsys.readouterr().err
    assert raff2urdf(["--check", "--exact", str(out)]) == 0


def test_nothing_to_heal(root, tmp_path, typed):
    for robot in ("four_bar", "arm7"):
        said = typed("heal", root / f"robots/{robot}.raff", tmp_path / "out.raff", code=1)
        assert "there is nothing to heal" in said.err
        assert not (tmp_path / "out.raff").exists()


def test_existing_files_and_other_formats_are_refused(tilted, tmp_path, typed):
    assert "keeps the format" in typed("heal", tilted, tmp_path / "healed.urdf", code=1).err
    (tmp_path / "healed.raff").write_text("mine")
    assert "exists already" in typed("heal", tilted, tmp_path / "healed.raff", code=1).err


OUT_OF_REACH = """
  link 31 { parameters { d 900 } type 2 pred 0 }
  link 32 { parameters { d 100 } type 2 pred 31 }
  link 33 { parameters { d 5000 } type 2 pred 0 }
  frame 34 { parameters { d 100 } pred 32 }
  frame 35 { parameters { d 100 } pred 33 }
  constraint { frame 34 frame 35 type 2 }
} // end of robot definition
"""


def test_what_could_not_be_closed_is_not_written(tilted, tmp_path, typed):
    """Beside the linkage that can be healed is one that is out of reach: no number of it is wrong by rounding."""
    text = tilted.read_text(encoding="utf-8").replace("} // end of robot definition", OUT_OF_REACH)
    tilted.write_text(text, encoding="utf-8")
    out = tmp_path / "out" / "healed.raff"
    out.parent.mkdir()
    said = typed("heal", tilted, out, code=1)
    assert said.out == ""
    assert "what would be written can't be loaded: healed.raff: robot 'linkage'" in said.err
    assert "'frame34-frame35' (revolute" in said.err
    assert list(out.parent.iterdir()) == []


@pytest.fixture
def bars(text_file):
    """A four-bar as a URDF, its coupler's axis tilted by a little and its loop in a file of the same name."""
    joints = [
        UrdfJoint("to_crank", "ground", "crank", kind="continuous"),
        UrdfJoint("to_coupler", "crank", "coupler", "0 0.1 0", f"0 {math.radians(TILTED)!r} 1", "continuous"),
        UrdfJoint("to_rocker", "ground", "rocker", "0.3 0 0", kind="continuous"),
        UrdfJoint("to_pin", "coupler", "pin", "0.4 0.2 0", kind="continuous"),
        UrdfJoint("to_hole", "rocker", "hole", "0.1 0.3 0", kind="fixed"),
    ]
    path = text_file("bars.urdf", urdf_text(joints))
    path.with_suffix(".yaml").write_text("closed_loop: [[pin, hole]]\ntype: ['6d']\n", encoding="utf-8")
    return path


def test_loops_that_would_be_lost_are_told_and_the_remedy_works(bars, tmp_path, typed):
    out = tmp_path / "healed.urdf"
    said = typed("heal", bars, out, code=1)
    assert f"{out}: would lack the loops 'pin-hole': copy bars.yaml to healed.yaml first" in said.err
    assert not out.exists()
    (tmp_path / "healed.yaml").write_bytes(bars.with_suffix(".yaml").read_bytes())
    assert main(["heal", str(bars), str(out)]) == 0
    assert cinegen.load(out).mobility == 1  # without a warning
