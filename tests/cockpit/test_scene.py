"""Meshes in the page: in the colour that the URDF says, or in their own, base_poses_at_start on the floor."""

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
import umsgpack
from example_robots import SHARE, UR5

import cinegen
from cinegen.cockpit import Page, RobotScene
from cinegen.cockpit.surfaces import merged, surface_of
from cinegen.collision.convex_hull import hull
from cinegen.collision.shapes import SHAPES as KINDS
from cinegen.collision.triangle_mesh import tree_of

URDF = """<robot name="r"><link name="base"><visual><geometry>{}</geometry>{}</visual></link></robot>"""
COLOUR = '<material name="m"><color rgba="{}"/></material>'


@pytest.fixture(autouse=True)
def _no_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def drawn(mechanism):
    """What the page is sent of objects and transforms, by path and kind."""
    page = Page()
    RobotScene(page, {"it": mechanism})
    return {
        f"{path.removeprefix('/meshcat/')} {kind}": umsgpack.unpackb(message)
        for (path, kind, _), message in page.scene().items()
    }


def shown(tmp_path, mesh, material=""):
    """The object that a URDF of one mesh becomes."""
    text = URDF.format(f'<mesh filename="{mesh}"/>', material)
    (tmp_path / "r.urdf").write_text(text)
    return drawn(cinegen.load(tmp_path / "r.urdf"))["cinegen/:it/:base/0 set_object"]["object"]


@pytest.fixture
def box(tmp_path):
    """Of 2 x 2 x 2, as box.stl, box.obj and blue box.dae."""
    box = trimesh.creation.box((2.0, 2.0, 2.0))
    box.export(tmp_path / "box.stl")
    box.export(tmp_path / "plain.obj")
    lines = (tmp_path / "plain.obj").read_text()
    (tmp_path / "box.obj").write_text(f"mtllib box.mtl\nusemtl red\n{lines}")
    (tmp_path / "gone.obj").write_text(f"mtllib gone.mtl\nusemtl red\n{lines}")
    (tmp_path / "box.mtl").write_text("newmtl red\nKd 1 0 0\n")
    blue = trimesh.visual.material.PBRMaterial(baseColorFactor=[0, 0, 255, 255])
    box.visual = trimesh.visual.TextureVisuals(material=blue)
    box.export(tmp_path / "box.dae")
    return box


@pytest.mark.parametrize("ending", ["stl", "obj", "dae"])
def test_a_mesh_has_the_colour_that_the_urdf_says(tmp_path, box, ending):
    thing = shown(tmp_path, f"box.{ending}", COLOUR.format("1 0.5 0 0.25"))
    assert thing["object"]["type"] == "Mesh"
    assert (thing["materials"][0]["color"], thing["materials"][0]["opacity"]) == (0xFF8000, 0.25)


def test_every_colour_of_a_mesh_is_shown(tmp_path):
    """Collada may lay several materials on one mesh, which the viewer's own reader loses."""
    sent = drawn(cinegen.load(SHARE / UR5))
    parts = {path: thing["object"] for path, thing in sent.items() if "shoulder_link" in path and "object" in thing}
    assert len(parts) == 3
    assert len({thing["materials"][0]["color"] for thing in parts.values()}) == 3


@pytest.mark.parametrize("name", ["plain.obj", "gone.obj", "box.stl"])
def test_a_mesh_without_colours_has_the_usual_one(tmp_path, box, name):
    thing = shown(tmp_path, name)
    assert thing["object"]["type"] == "Mesh"
    assert thing["materials"][0]["color"] == 0xE6E6E6


def test_the_view_holds_all_of_a_mesh_and_the_floor_is_below_it(robot):
    """rx90 stands with its shoulder at the origin, on a pedestal of 420 mm."""
    sent = drawn(robot("rx90"))
    whole = np.reshape(sent["cinegen set_transform"]["matrix"], (4, 4)).T
    foot = (whole @ [0.0, 0.0, -0.42, 1.0])[2]
    floor = np.reshape(sent["/Grid set_transform"]["matrix"], (4, 4)).T[2, 3]
    assert floor == pytest.approx(foot - 0.05)
    for x, y in ((0.165, 0.0), (-0.165, 0.0), (0.0, 0.165)):
        assert np.linalg.norm((whole @ [x, y, -0.42, 1.0])[:3]) <= 1.6 + 1e-6


SHAPES = """<visual><origin xyz="0.1 {y} 0" rpy="0.3 0.2 0.1"/><geometry><box size="0.2 0.4 0.6"/></geometry>
<material name="red"><color rgba="1 0 0 1"/></material></visual>
<visual><geometry><sphere radius="0.2"/></geometry><material name="glass"><color rgba="0 0 1 0.5"/></material></visual>
<visual><origin xyz="0 0 1"/><geometry><cylinder radius="0.1" length="0.5"/></geometry>
<material name="green"><color rgba="0 1 0 1"/></material></visual>
<visual><origin rpy="0 0 1"/><geometry><mesh filename="box.stl" scale="0.1 0.2 0.3"/></geometry></visual>"""


def test_a_robot_of_many_shapes_is_drawn_with_one_mesh_for_each_opacity_of_a_link(tmp_path, box):
    """Where the shapes are, in their colours."""

    def meshes(shapes):
        (tmp_path / "r.urdf").write_text(f'<robot name="r"><link name="base">{shapes}</link></robot>')
        sent = drawn(cinegen.load(tmp_path / "r.urdf"))
        parts = {path: command["object"] for path, command in sent.items() if "object" in command and "/:base/" in path}
        return [thing for path, thing in parts.items() if "triad" not in path]

    assert len(meshes(SHAPES.format(y=0))) == 4
    parts = meshes("".join(SHAPES.format(y=i) for i in range(200)))
    opaque, glass = sorted(parts, key=lambda part: -part["materials"][0]["opacity"])
    assert [part["materials"][0]["opacity"] for part in (opaque, glass)] == [1.0, 0.5]

    def surface(mesh, count):
        data = mesh["geometries"][0]["data"]
        arrays = [data["attributes"]["position"], data["attributes"]["color"], data["index"]]
        corners, colours, faces = (
            np.frombuffer(array["array"].data, kind).reshape(-1, 3)
            for array, kind in zip(arrays, ("<f4", "<f4", "<u4"), strict=True)
        )
        solid = trimesh.Trimesh(corners, faces, process=False)
        solid.merge_vertices(merge_norm=True)
        assert solid.volume == pytest.approx(count, rel=0.07)  # seen from outside
        return corners, colours

    volumes = 0.2 * 0.4 * 0.6, np.pi * 0.1**2 * 0.5, 8.0 * 0.1 * 0.2 * 0.3
    corners, colours = surface(opaque, 200 * sum(volumes))
    turn = trimesh.transformations.euler_matrix(0.3, 0.2, 0.1)[:3, :3]
    reach = np.abs(turn) @ [0.1, 0.2, 0.3]
    red, green = ((colours == colour).all(axis=1) for colour in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    assert corners[red].max(axis=0) == pytest.approx(reach + np.array([0.1, 199.0, 0.0]), abs=1e-4)
    assert corners[green].min(axis=0) == pytest.approx([-0.1, -0.1, 0.75], abs=1e-6)
    assert np.abs(corners[~(red | green)]).max(axis=0)[2] == pytest.approx(0.3)
    corners, colours = surface(glass, 200 * 4.0 / 3.0 * np.pi * 0.2**3)
    assert np.linalg.norm(corners, axis=1) == pytest.approx(0.2)
    assert (colours == [0.0, 0.0, 1.0]).all()


@pytest.mark.parametrize(
    "kind", [*(kind for kind in KINDS if kind not in {coal.Halfspace, coal.Plane}), coal.Ellipsoid]
)
def test_every_kind_of_shape_is_drawn_as_a_closed_surface_alone_or_merged(kind):
    """A kind that is added to the table too, and one that is not in it: as its bounding box."""
    cube = trimesh.creation.box((2.0, 2.0, 2.0))
    made = {
        coal.Box: lambda: coal.Box(0.2, 0.4, 0.6),
        coal.Sphere: lambda: coal.Sphere(0.2),
        coal.Convex: lambda: hull(cube.vertices).shape,
        coal.BVHModelOBBRSS: lambda: tree_of(cube.vertices, cube.faces),
        coal.Ellipsoid: lambda: coal.Ellipsoid(0.1, 0.2, 0.3),
    }
    solid = pin.GeometryObject("", 0, pin.SE3.Identity(), made.get(kind, lambda: kind(0.1, 0.5))())
    volume = {coal.BVHModelOBBRSS: 8.0, coal.Ellipsoid: 0.2 * 0.4 * 0.6}.get(kind) or solid.geometry.computeVolume()
    (mesh,) = merged([(solid, pin.SE3.Identity())])
    for corners, faces in (surface_of(solid), (mesh.geometry.vertices, mesh.geometry.faces)):
        surface = trimesh.Trimesh(corners, faces)
        surface.merge_vertices(merge_norm=True)
        assert surface.is_watertight
        assert surface.volume == pytest.approx(volume, rel=0.08)
