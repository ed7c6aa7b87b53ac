"""Whatever stands in a scene: it is read, or refused with a SceneError that names a place."""

import copy
import json

import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from cinegen.collision import SceneError, scene_of
from cinegen.collision.obstacle_kinds import KINDS

FULL = {
    "name": "all",
    "robot": "planar_3r.raff",
    "node": "tool",
    "safety": 0.02,
    "influence": 0.3,
    "up": [0, 0, 1],
    "start": {"joints": {"joint1": 0.1, "joint2": 0.2}},
    "goal": {"point": [0.5, 0.2], "angle": 0.1},
    "obstacle": [
        {"kind": "sphere", "name": "a", "radius": 0.1, "point": [2, 2, 0]},
        {"kind": "box", "size": [0.1, 0.2, 0.3], "rpy": [0.1, 0.2, 0.3]},
        {"kind": "capsule", "radius": 0.1, "ends": [[0, 0], [1, 1]]},
        {"kind": "half_plane", "normal": [1, 0]},
        {"kind": "disc", "radius": 0.1, "height": 1, "angle": 1},
        {"kind": "polygon", "points": [[0, 0], [1, 0], [0, 1]]},
        {"kind": "mesh", "file": "box.stl", "scale": 0.1, "convex": "hull"},
    ],
}

json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=4)
    | st.sampled_from([*KINDS, "tool", "joint1", [], {}, [0, 0], [[0, 0], [1, 0], [0, 1]]]),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from([*FULL, "kind", "x"]), inner, max_size=3)
    ),
    max_leaves=6,
)


def _places(value, path=()):
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield from _places(inner, (*path, key))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the mesh lies."""
    made = tmp_path_factory.mktemp("scenes")
    trimesh.creation.box((1, 1, 1)).export(made / "box.stl")
    return made


PLACES = list(_places(FULL))


def _put(path, value):
    values = copy.deepcopy(FULL)
    if not path:
        return value
    at = values
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    return values


@settings(max_examples=500)
@given(st.sampled_from(PLACES), json_values)
def test_any_value_anywhere_is_read_or_refused(robot, folder, path, value):
    values = _put(path, value)
    try:
        scene = scene_of(values, folder, robot("planar_3r"))
    except SceneError as refusal:
        said = str(refusal)
        assert said.startswith("scene"), said
        assert path == () or any(str(key) in said for key in path if isinstance(key, str)), said
        return
    # what is read is read the same again
    again = scene_of(json.loads(json.dumps(scene.document(), allow_nan=False)), folder, robot("planar_3r"))
    assert again.start.tolist() == scene.start.tolist()
    assert len(again.obstacles) == len(scene.obstacles)
