"""`cinegen info --collision`: every pair of links, and why it is checked, or not."""

from __future__ import annotations

import json
import sysconfig
from pathlib import Path

from cinegen.cli import main

PANDA = (
    Path(sysconfig.get_path("purelib"))
    / "cmeel.prefix/share/example-robot-data/robots/panda_description/urdf/panda.urdf"
)


def test_all_pairs_are_listed_with_reasons_and_contact_at_home(capsys):
    assert main(["info", str(PANDA), "--collision", "--json"]) == 0
    (report,) = json.loads(capsys.readouterr().out)
    found = {frozenset(pair["links"]): pair for pair in report["collision"]["pairs"]}
    assert found[frozenset(("panda_link1", "panda_link2"))]["reason"].startswith("adjacent")
    contact = found[frozenset(("panda_link5", "panda_hand"))]
    assert contact["reason"] == "checked"
    assert contact["depth_at_home"] > 0.01
    assert "depth_at_home" not in found[frozenset(("panda_link0", "panda_hand"))]
    shapes = {shape["link"]: shape["shape"] for shape in report["collision"]["shapes"]}
    assert "mesh" in shapes["panda_hand"] or "hull" in shapes["panda_hand"]


def test_pairs_are_printed(capsys):
    assert main(["info", "planar_3r", "--collision"]) == 0
    out = capsys.readouterr().out
    assert "link1 - link2: adjacent" in out
    assert "base - link2: checked" in out
