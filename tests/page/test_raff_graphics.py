"""What a page with an editor draws: the skeletons that Python draws, and of graphic files those that it holds."""

from __future__ import annotations

import numpy as np
import pytest
from raff_in_node import graphics_in_node, planes_in_node, skeletons_in_node
from test_raff_analysis import OTHERS, files

import cinegen
from cinegen.model.motion_plane import motion_plane
from cinegen.page.graphics import embedded, key_of
from raff2urdf.errors import RaffWarning
from raff2urdf.graphics.skeleton import SkeletonDrawing
from raff2urdf.raff.compound import expanded
from raff2urdf.raff.reader import parse

SEVERAL = """RAFF t robot r {
  link 1 { parameters { d 500 r 40 } joint ball pred 0 }
  link 2 { parameters { theta 20 alpha 90 d 400 } joint universal pred 1 variable y { home -10 } }
  link 3 { parameters { r 250 } joint cylindrical pred 2 }
  link 4 { parameters { theta 30 r 720 } joint planar pred 3 }
  link 5 { parameters { gamma 30 d 90 epsilon 20 r 70 } type 1 pred 4 }
  link 6 { parameters { d 1 } type 0 pred 5 } frame 7 { parameters { r 33 } pred 6 } link 8 { type 2 pred 4 }
  base { parameters { d 3000 } }
}"""


def _numbers(visual):
    """The kind, sizes, placement and colour of a shape of a URDF."""
    shape = visual.geometry
    rgb = [round(255 * one) for one in visual.material.rgba[:3]]
    if shape.cylinder is not None:
        kind, size = "cylinder", [shape.cylinder.radius, shape.cylinder.length]
    elif shape.sphere is not None:
        kind, size = "sphere", [shape.sphere.radius]
    else:
        kind, size = "box", shape.box.size
    return kind, [*size, *visual.origin[:3].ravel()], (rgb[0] << 16) + (rgb[1] << 8) + rgb[2]


def test_skeletons_are_those_of_python(root):
    texts = [*files(root), *OTHERS, SEVERAL]
    shapes = 0
    for text, robots in zip(texts, skeletons_in_node(texts), strict=True):
        document = parse(text)
        for robot, found in zip(document.robots, robots, strict=True):
            flat = expanded(robot)
            skeleton = SkeletonDrawing(document, flat)
            for node in (flat.nodes[number] for number in robot.nodes):  # nothing is drawn between successive joints
                expected = [_numbers(one) for one in skeleton.draw(node)]
                mine = found[node.node]
                assert [(one["kind"], one["colour"]) for one in mine] == [
                    (kind, colour) for kind, _, colour in expected
                ]
                for one, (_, numbers, _) in zip(mine, expected, strict=True):
                    own = [*one["size"], *one["placement"]]
                    assert np.allclose(own, numbers, rtol=0.0, atol=2e-6 * skeleton.radius), (robot.name, node.node)
                shapes += len(mine)
    assert shapes > 400


SLIDES = """RAFF t robot r { link 1 { parameters { alpha 90 } type 1 pred 0 }
link 2 { parameters { d 50 } type 1 pred 1 } link 3 { parameters { alpha 90 d 50 } type 1 pred 2 } }"""
IN_SPACE = (
    SLIDES[:-1]
    + "link 4 { parameters { alpha 90 theta 90 } type 1 pred 3 } link 5 { parameters { alpha 90 } type 1 pred 4 } }"
)


def test_planes_of_motion_are_those_of_python(root, tmp_path):
    """They decide from where a robot is seen first."""
    named = {path.stem: path.read_text() for path in sorted((root / "robots").glob("*.raff"))}
    texts = {**named, "slides": SLIDES, "space": IN_SPACE}
    planes = 0
    for (name, text), robots in zip(texts.items(), planes_in_node(texts.values()), strict=True):
        path = root / "robots" / f"{name}.raff" if name in named else tmp_path / f"{name}.raff"
        if name not in named:
            path.write_text(text)
        for robot, found in zip(parse(text).robots, robots, strict=True):
            expected = motion_plane(cinegen.load(path, robot.name))
            assert (found is None) == (expected is None), name
            if expected is not None:
                assert abs(np.dot(found, expected)) == pytest.approx(1.0, abs=1e-9), name
                planes += 1
    assert 5 <= planes < len(texts)


WHOLE, PART, WRONG = (
    {"meshes": 2, "triangles": 10, "problem": None},
    {"meshes": 1, "triangles": 5, "problem": "without its 1 3DSOLID: solids can't be read"},
    {"meshes": 0, "triangles": 0, "problem": "not found"},
)
KNOWN = {"g/arm.stl": WHOLE, "g/hand.dxf": PART, "g/wrong.nff": WRONG, "/root.stl": WHOLE}
NAMED = """RAFF t robot r { path "g/"
base { filename { "arm.stl" "./arm.stl" } }
link 1 { type 2 pred 0 filename { "hand.dxf" } filename { "wheel.off" } parameters { d 500 } }
link 2 { type 2 pred 1 filename { "wrong.nff" "/root.stl" } }
link 3 { type 2 pred 2 filename { "arms.stl" } }
link 4 { joint ball pred 2 filename { } }
link 5 { type 2 pred 2 }
} robot s { base { filename { "g//arm.stl" } } }"""


def test_files_that_a_page_does_not_hold_are_reported_where_they_are_named():
    (found,) = graphics_in_node([{"text": NAMED, "known": KNOWN}])
    assert found["shown"] == {
        "r": {
            "base": ["g/arm.stl"], "link1": ["g/hand.dxf"], "link2": ["/root.stl"], "link3": None, "link4": [],
            "link5": None,
        },
        "s": {"base": ["g/arm.stl"]},
    }  # fmt: skip
    assert (found["meshes"], found["triangles"], found["more"]) == (2 + 1 + 2 + 2, 10 + 5 + 10 + 10, 0)
    held = "this page holds only the graphics that its text named when it was written"
    assert [one.split("\n")[0] for one in found["problems"]] == [
        "t.raff:3:35: link 1 is drawn with a part of 'hand.dxf': without its 1 3DSOLID: solids can't be read",
        f"t.raff:3:59: link 1 is drawn without 'wheel.off': {held} (known: g/arm.stl, g/hand.dxf, /root.stl)",
        "t.raff:4:35: link 2 is drawn without 'wrong.nff': not found",
        f"t.raff:5:35: link 3 is drawn as a skeleton, without 'arms.stl': {held}: did you mean 'g/arm.stl'?",
    ]


def test_many_missing_files_are_counted():
    text = f"RAFF t robot r {{ base {{\n{chr(10).join(500 * ['filename { ' + chr(34) + 'a' + chr(34) + ' }'])}\n}} }}"
    (found,) = graphics_in_node([{"text": text, "known": {}}])
    assert (len(found["problems"]), found["more"]) == (100, 400)


@pytest.mark.parametrize(
    ("path", "name", "key"),
    [
        ("g/", "a.stl", "g/a.stl"),
        ("", "g/./a.stl", "g/a.stl"),
        ("/g", "a.stl", "/g/a.stl"),
        ("g", "/a.stl", "/a.stl"),
        ("g", "~/a.stl", "~/a.stl"),
        ("~/g", "a.stl", "~/g/a.stl"),
        ("g", "../a.stl", "g/../a.stl"),
    ],
)
def test_a_file_has_one_key_in_both_languages(path, name, key):
    assert key_of(path, name) == key
    text = f'RAFF t robot r {{ path "{path}" base {{ filename {{ "{name}" }} }} }}'
    (found,) = graphics_in_node([{"text": text, "known": {key: WHOLE}}])
    assert found["shown"] == {"r": {"base": [key]}}


def test_what_a_page_holds(root, tmp_path):
    text = (root / "robots" / "delta4.raff").read_text()
    base, platform = embedded(text, "delta4.raff", root / "robots")
    assert [base["key"], platform["key"]] == ["graphics/delta_base.nff", "graphics/delta_platform.nff"]
    assert (base["uses"], base["problem"]) == (1, None)
    assert min(len(base["commands"]), len(platform["commands"])) >= 1
    with pytest.warns(RaffWarning, match=r"graphics that can't be shown: graphics/delta_base.nff \(not found\); "):
        missing = embedded(text, "delta4.raff", tmp_path)
    assert [(one["commands"], one["problem"]) for one in missing] == 2 * [([], "not found")]
    with pytest.warns(RaffWarning, match="errors"):
        assert embedded("RAFF t robot {", "t.raff", tmp_path) == []
