"""Robots without graphics, drawn as machines: plates hold their joints, tubes end at them, slides stay together, wheels
touch, and what is drawn has no effect on what collides and weighs."""

import io
import math
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

import cinegen
import raff2urdf
from raff2urdf import RaffError, loads
from raff2urdf.conversion import describe
from raff2urdf.graphics.bodies import BodyDrawing
from raff2urdf.graphics.body_shapes import SHARED, DrawnBody, Shape
from raff2urdf.graphics.skeleton import BASE, BRANCHES, JOINT, SkeletonDrawing
from raff2urdf.graphics.solids import stl_of, tooth_numbers, triangles
from raff2urdf.graphics.wheels import CouplingDrawing, Mesh
from raff2urdf.raff.document import Document, JointType
from raff2urdf.tree import placements

ROBOTS = Path(raff2urdf.__file__).parent.parent / "robots"
NAMES = sorted(path.stem for path in ROBOTS.glob("*.raff"))
Array = NDArray[np.float64]


def robot(*rows: str) -> Document:
    return loads("\n".join(["RAFF t", "robot r { base { }", *rows, "}"]))


def coupled(follower: str, drive: str) -> Document:
    return robot("link 3 { type 2 pred 0 actuated 1 }", follower, f"coupling {{ link 4 link 3 {drive} }}")


def drawn(document: Document) -> BodyDrawing:
    return BodyDrawing(document, document.robot())


def shapes_of(drawing: BodyDrawing) -> list[Shape]:
    return [shape for node in drawing.robot.nodes.values() for shape in drawing.of(node)]


def corners(shape: Shape) -> Array:
    """The corners (n, 3) of a mesh in its node's frame."""
    local = triangles(shape.recipe).reshape(-1, 3) * shape.sizes
    return local @ shape.placement[:3, :3].T + shape.placement[:3, 3]


def plates(drawing: BodyDrawing, number: int) -> list[Shape]:
    return [shape for shape in drawing.of(drawing.robot.nodes[number]) if shape.recipe.startswith("plate")]


def volume(surface: Array) -> float:
    return float(np.linalg.det(surface).sum() / 6.0)


# --- bodies --------------------------------------------------------------------------------------------------------


@given(st.lists(st.tuples(st.floats(0, 360), st.floats(60, 400)), min_size=3, max_size=7), st.floats(-40, 40))
@settings(max_examples=40)
def test_a_plate_holds_all_joints_of_a_link_and_hides_none(polar: list[tuple[float, float]], tilt: float) -> None:
    """Where they are in a plane; the eye of each joint stands out of the plate on both sides."""
    rows = [f"link {1 + i} {{ parameters {{ gamma {a} d {d} }} type 2 pred 9 }}" for i, (a, d) in enumerate(polar)]
    drawing = drawn(robot(f"link 9 {{ parameters {{ alpha {tilt} d 50 }} type 2 pred 0 }}", *rows))
    points = np.array([[0.0, 0.0], *([d * math.cos(math.radians(a)), d * math.sin(math.radians(a))] for a, d in polar)])
    points *= 1e-3
    shapes = plates(drawing, 9)
    if not shapes:  # all in a line
        spread = np.linalg.svd(points - points.mean(axis=0))[1]
        assert len(np.unique(np.round(points / drawing.unit), axis=0)) < 3 or spread[1] < 8.0 * drawing.unit
        return
    (plate,) = shapes
    vertices = corners(plate)
    hull = ConvexHull(vertices)
    inside = hull.equations[:, :3] @ np.column_stack([points, np.zeros(len(points))]).T + hull.equations[:, 3:]
    assert inside.max() < -0.3 * drawing.unit
    assert np.abs(vertices[:, 2]).max() < 0.5 * 1.3 * drawing.unit  # half the length of an eye


def test_what_rigid_loops_weld_together_is_one_body() -> None:
    """The platform of a delta is in three branches: one plate, with the wrists of all."""
    drawing = drawn(raff2urdf.load(ROBOTS / "delta4_linear.raff"))
    assert {5, 10, 11, 16, 17, 20} == set(drawing.bodies[5].nodes)
    world = placements(drawing.document, drawing.robot)
    (plate,) = plates(drawing, 5)
    hull = ConvexHull(corners(plate) @ world[5][:3, :3].T + world[5][:3, 3])
    for wrist in (5, 10, 16):
        assert (hull.equations @ world[wrist][:, 3]).max() < 0.0
    assert not any(plates(drawing, number) for number in (10, 11, 16, 17, 20))


def test_a_loop_of_another_kind_welds_nothing() -> None:
    """The kind that the caller asks for counts: a ball in place of the weld leaves two bodies, with a sphere."""
    document = raff2urdf.load(ROBOTS / "five_bar.raff")
    welded, pinned = (describe(document, document.robot(), ROBOTS, kinds)[0] for kinds in ({}, {"link5-tool": "ball"}))
    assert pinned.count("<sphere") > welded.count("<sphere")


@pytest.mark.parametrize("name", NAMES)
def test_every_joint_is_touched_by_both_of_its_bodies(name: str) -> None:
    """Of each joint, a shape of the parent's body and one of the child's are at its origin: tubes end at joints."""
    document = raff2urdf.load(ROBOTS / f"{name}.raff")
    for raff_robot in document.robots:
        drawing = BodyDrawing(document, raff_robot)
        world = placements(document, raff_robot)
        for link in drawing.robot.links:
            bodies = [drawing.bodies[link.pred], drawing.bodies[link.number]]
            thin = [body for body in bodies if not body.shapes]  # inside a joint
            if link.type is not JointType.REVOLUTE or thin:
                continue
            for body in bodies:
                origin = np.linalg.inv(world[next(iter(body.nodes))]) @ world[link.number][:, 3]
                near = min(distance(shape, origin[:3]) for shape in body.shapes)
                assert near < 1.2 * drawing.unit, (link.node, near / drawing.unit)


def distance(shape: Shape, point: Array) -> float:
    """An upper bound of the distance of a point (3,) from a shape."""
    local = shape.placement[:3, :3].T @ (point - shape.placement[:3, 3])
    if shape.kind == "mesh":
        mesh = trimesh.Trimesh(corners(shape), np.arange(len(corners(shape))).reshape(-1, 3))
        return float(trimesh.proximity.closest_point(mesh, [point])[1][0])
    if shape.kind == "sphere":
        return max(0.0, float(np.linalg.norm(local)) - shape.sizes[0])
    sizes = shape.sizes if shape.kind == "box" else [2.0 * shape.sizes[0]] * 2 + [shape.sizes[1]]
    return float(np.linalg.norm(np.maximum(np.abs(local) - np.array(sizes) / 2.0, 0.0)))


def span(bar: Shape) -> tuple[float, float]:
    """Both ends of a bar along z."""
    return bar.placement[2, 3] - bar.sizes[-1] / 2, bar.placement[2, 3] + bar.sizes[-1] / 2


@given(st.integers(-2000, 2000), st.integers(10, 2000), st.floats(0, 1))
@settings(max_examples=100)
def test_rod_and_sleeve_stay_together_over_the_whole_stroke(low: int, stroke: int, part: float) -> None:
    """As do carriage and rail."""
    high, home = low + stroke, low + part * stroke
    drawing = drawn(robot(f"link 1 {{ parameters {{ d 100 r {home} }} type 1 pred 0 limits {{ {low} {high} }} }}"))
    on_base = [bar for bar in drawing.of(drawing.robot.base) if bar.kind in ("cylinder", "box") and bar.placement[0, 3]]
    (moving,) = [bar for bar in drawing.of(drawing.robot.nodes[1]) if bar.kind in ("cylinder", "box")]
    begins, ends = zip(*(span(bar) for bar in on_base), strict=True)
    for value in (1e-3 * low, 1e-3 * home, 1e-3 * high):
        begin, end = np.add(span(moving), value)
        assert min(max(ends), end) > max(min(begins), begin)


# --- couplings -----------------------------------------------------------------------------------------------------


def meshes(document: Document) -> list[Mesh]:
    drawing = CouplingDrawing(drawn(document))
    return [mesh for coupling in document.robot().couplings for mesh in drawing.meshes(coupling)]


def pair(distance: float, ratio: float, name: str = "", alpha: float = 0.0) -> Document:
    label = f'name "{name}"' if name else ""
    return robot(
        "link 1 { parameters { theta 20 } type 2 pred 0 actuated 1 }",
        f"link 2 {{ parameters {{ d {distance} alpha {alpha} theta -10 }} type 2 pred 0 }}",
        *(f"link {3 + i} {{ parameters {{ d 100 }} type 2 pred {2 + i} }}" for i in range(3)),
        f"coupling {{ {label} link 2 link 1 ratio {ratio} }}",
    )


@given(st.floats(20, 150), st.floats(0.1, 8), st.sampled_from([0.0, 180.0]))
@settings(max_examples=60)
def test_pitch_radii_have_the_ratio_and_touch(distance: float, ratio: float, alpha: float) -> None:
    """Whichever way the axes point: the sense of the ratio is about a common direction."""
    (mesh,) = meshes(pair(distance, -ratio if alpha == 0.0 else ratio, alpha=alpha))
    assert mesh.kind == "spur"
    assert mesh.radii[1] / mesh.radii[0] == pytest.approx(ratio)
    assert sum(mesh.radii) == pytest.approx(1e-3 * distance)
    assert np.linalg.norm(mesh.centres[1] - mesh.centres[0]) == pytest.approx(1e-3 * distance)


@pytest.mark.parametrize(("distance", "ratio", "name", "kind"), [
    (100.0, 0.5, "", "belt"), (4000.0, -2.0, "", "crossed"), (100.0, -0.5, "timing belt", "crossed"),
    (100.0, -0.5, "Chain of the elbow", "crossed"),
])  # fmt: skip
def test_what_turns_alike_is_far_apart_or_is_called_so_has_pulleys(distance, ratio, name: str, kind: str) -> None:
    (mesh,) = meshes(pair(distance, ratio, name))
    assert (mesh.kind, mesh.radii[1] / mesh.radii[0]) == (kind, pytest.approx(abs(ratio)))
    assert sum(mesh.radii) < 1e-3 * distance


def test_a_planetary_gear_has_its_ring_around_the_planets() -> None:
    """Sun 24, planets 24, ring 72 teeth of module 2: pitch radii 24 and 72."""
    gears = meshes(raff2urdf.load(ROBOTS / "planetary_gear.raff"))
    assert [mesh.kind for mesh in gears] == ["ring"] * 3 + ["spur"] * 3
    for mesh in gears:
        expected = (0.024, 0.072) if mesh.kind == "ring" else (0.024, 0.024)
        assert mesh.radii == pytest.approx(expected)


def test_a_differential_has_bevel_gears_with_one_apex() -> None:
    gears = meshes(raff2urdf.load(ROBOTS / "differential_wrist.raff"))
    assert [mesh.kind for mesh in gears] == ["bevel", "bevel"]
    for mesh in gears:
        (high, aside), contact = (np.linalg.norm(centre) for centre in mesh.centres), sum(mesh.centres)
        assert (mesh.radii[0], mesh.radii[1]) == pytest.approx((aside, high))  # 90 degrees between the axes
        speeds = [np.cross(axis, contact) for axis in mesh.axes]
        assert mesh.ratio * speeds[0] == pytest.approx(speeds[1])  # no slip
    assert {round(float(np.sign(mesh.centres[1] @ mesh.axes[1]))) for mesh in gears} == {-1, 1}


@given(st.floats(0.05, 20))
@settings(max_examples=60)
def test_numbers_of_teeth_have_the_ratio(ratio: float) -> None:
    """To 2 % at least, and exactly if it is a ratio of small numbers."""
    teeth, other = tooth_numbers(ratio)
    assert 9 <= min(teeth, other) <= max(teeth, other) <= 400
    assert other / teeth == pytest.approx(ratio, rel=0.02)
    assert (tooth_numbers(1e6), tooth_numbers(3.0)) == ((3, 400), (18, 54))
    assert tooth_numbers(-0.4) == (45, 18)


@pytest.mark.parametrize("name", ["planetary_gear", "pair"])
def test_teeth_go_into_gaps_at_every_angle(name: str) -> None:
    """Outlines of meshing wheels overlap by less than an eighth of the height of a tooth, wherever the robot is."""
    document = raff2urdf.load(ROBOTS / "planetary_gear.raff") if name != "pair" else pair(60.0, -0.4)
    gears = meshes(document)
    for drive in (0.0, 0.11, 0.5, 2.0):
        q = {"joint1": math.radians(20.0) + drive, "joint2": math.radians(-10.0) - 0.4 * drive}
        if name != "pair":
            q = {"joint1": drive, "joint2": drive / 4.0} | {f"joint{i}": -0.75 * drive for i in (3, 4, 5)}
        world = placements(document, document.robot(), q)
        for mesh in gears:
            pairs = zip(mesh.wheels, mesh.radii, strict=True)
            outlines = [outline(wheel.body, world, radius) for wheel, radius in pairs]
            depth = overlap(*outlines, inner=mesh.kind == "ring")
            assert depth < 0.125 * 2.0 * 2.0 * min(mesh.radii) / 18.0, (drive, mesh.kind)


def outline(body: DrawnBody, world: dict[int, Array], radius: float) -> tuple[Array, Array]:
    """The centre (3,) and the corners (n, 3) of the teeth of the wheel with that pitch radius on a body."""
    gears = [gear for gear in body.shapes if gear.recipe.startswith(("wheel", "ring/"))]
    (shape,) = [gear for gear in gears if gear.sizes[0] == pytest.approx(radius)]
    placement = world[next(iter(body.nodes))] @ shape.placement
    rim = triangles(shape.recipe).reshape(-1, 3) * shape.sizes
    length = np.linalg.norm(rim[:, :2], axis=1)
    rim = rim[(np.abs(length - radius) < 0.2 * radius) & (rim[:, 2] > 0.0)]
    flat = np.unique(np.round(rim, 12), axis=0)
    return placement[:3, 3], flat @ placement[:3, :3].T + placement[:3, 3]


def overlap(first: tuple[Array, Array], second: tuple[Array, Array], inner: bool) -> float:
    """How deep corners of either outline are in the other one, seen along z."""
    deepest = 0.0
    for (centre, teeth), (_, others), is_ring in ((second, first, inner), (first, second, False)):
        polar = teeth[:, :2] - centre[:2]
        angles = np.arctan2(polar[:, 1], polar[:, 0])
        order = np.argsort(angles)
        radii = np.linalg.norm(polar, axis=1)[order]
        probes = others[:, :2] - centre[:2]
        surface = np.interp(np.arctan2(probes[:, 1], probes[:, 0]), angles[order], radii, period=2.0 * math.pi)
        inside = (np.linalg.norm(probes, axis=1) - surface) * (1.0 if is_ring else -1.0)
        near = np.abs(np.linalg.norm(probes, axis=1) - surface) < 0.2 * surface
        deepest = max(deepest, float(inside[near].max(initial=0.0)))
    return deepest


@pytest.mark.parametrize("radius", [25.0, -25.0])
def test_a_pinion_rolls_on_its_rack_over_the_whole_stroke(radius: float) -> None:
    """At every value the pitch line of the rack touches the pitch circle, and the rack extends there."""
    slide = "link 4 { parameters { alpha 90 d 30 r 20 } type 1 pred 0 limits { -60 90 } }"
    document = coupled(slide, f"radius {radius}")
    drawing = drawn(document)
    (rack,) = [shape for shape in drawing.of(drawing.robot.nodes[4]) if shape.recipe.startswith("rack")]
    (pinion,) = [shape for shape in drawing.of(drawing.robot.nodes[3]) if shape.recipe.startswith("wheel")]
    assert pinion.sizes[0] == pytest.approx(0.025)
    for value in (-0.06, 0.02, 0.09):
        world = placements(document, document.robot(), {"joint4": value})
        placed, centre = world[4] @ rack.placement, (world[3] @ pinion.placement)[:3, 3]
        local = placed[:3, :3].T @ (centre - placed[:3, 3])
        assert local[1] == pytest.approx(0.025)  # above its pitch line
        assert abs(local[0]) < np.abs(triangles(rack.recipe)[:, :, 0]).max() * rack.sizes[0]
    here, ahead = (placements(document, document.robot(), {"joint4": value})[4][:3, 3] for value in (0.02, 0.03))
    arm = (world[4] @ rack.placement)[:3, 1] * -0.025
    rolled = np.cross([0.0, 0.0, 0.01 / (1e-3 * radius)], arm)
    assert rolled == pytest.approx(ahead - here, abs=1e-9)


@pytest.mark.parametrize("word", ["ratio", "radius", "lead"])
@pytest.mark.parametrize("number", [1e-300, 1e-3, 59.0 / 61.0, 1e3, 1e300])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_couplings_of_any_size_are_drawn_by_solids_or_not_at_all(word: str, number: float, sign: float) -> None:
    slide = "parameters { alpha 90 d 30 r 20 } type 1 pred 0 limits { -60 90000 }" if word == "radius" else ""
    slide = "parameters { d 40 r 60 } type 1 pred 0" if word == "lead" else slide
    for distance in (0.0, 1e-9, 50.0, 1e12):
        links = f"link 4 {{ {slide or f'parameters {{ d {distance} }} type 2 pred 0'} }}\n"
        links += "\n".join(f"link {5 + i} {{ parameters {{ d 100 }} type 2 pred {4 + i} }}" for i in range(3))
        for shape in shapes_of(drawn(coupled(links, f"{word} {sign * number}"))):
            assert all(0.0 < size < math.inf for size in shape.sizes)
            assert np.isfinite(shape.placement).all()
            assert not shape.recipe or volume(triangles(shape.recipe)) > 0.0


def test_a_screw_has_its_lead() -> None:
    drawing = drawn(coupled("link 4 { parameters { d 40 r 60 } type 1 pred 0 limits { 0 160 } }", "lead 15"))
    (screw,) = [shape for shape in drawing.of(drawing.robot.nodes[3]) if shape.recipe.startswith("screw")]
    turns = float(screw.recipe.split("/")[1].split(",")[0])
    assert screw.sizes[2] / turns == pytest.approx(0.015, rel=1e-5)
    assert screw.placement[2, 3] < 0.0
    assert screw.placement[2, 3] + screw.sizes[2] > 0.16


# --- solids --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_drawn_without_a_volume(name: str) -> None:
    document, recipes = raff2urdf.load(ROBOTS / f"{name}.raff"), set()
    for raff_robot in document.robots:
        for shape in shapes_of(BodyDrawing(document, raff_robot)):
            assert all(0.0 < size < math.inf for size in shape.sizes)
            recipes |= {shape.recipe} - {""}
    for text in recipes:
        mesh = trimesh.load(io.BytesIO(stl_of(text)), file_type="stl")
        mesh.merge_vertices()
        assert mesh.is_watertight, text
        assert mesh.volume > 0.0, text


@pytest.mark.parametrize("text", [
    "", "cube/1", "plate", "plate/", "plate/nan,1,0,0", "plate/1,inf,0,0", "plate/1,1,0", "plate/1,1" + ",1,2" * 3000,
    "wheel/1e9,1", "wheel/2.5,1", "wheel/-3,1", "wheel/3", "ring/9,1,1,1,1", "screw/1e6,0.1", "lathe/1e6,0,0,1,1",
    "lathe/x", "rack/1,1,1,1", "belt/0,1,1,1,1,1",
])  # fmt: skip
def test_a_recipe_that_makes_no_solid_is_refused(text: str) -> None:
    with pytest.raises(RaffError, match="is no solid: one of lathe, plate, wheel, "):
        triangles(text)


def test_a_robot_in_memory_names_its_solids_and_needs_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """So a recording or a map of it is drawn on any machine."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    document = raff2urdf.load(ROBOTS / "gough.raff")
    urdf, _ = describe(document, document.robot(), ROBOTS)
    assert 'filename="solid://plate/' in urdf
    assert not (tmp_path / "cache").exists()
    shapes = cinegen.load(ROBOTS / "gough.raff").visual.geometryObjects
    assert any(shape.meshPath.endswith(".stl") for shape in shapes)


# --- what it leaves alone ------------------------------------------------------------------------------------------


def test_bars_of_a_long_chain_are_seen() -> None:
    link = "link {} {{ parameters {{ d {} r 0.001 }} type 2 pred {} }}"
    document = robot(*(link.format(i, 100 * (i > 1), i - 1) for i in range(1, 101)))  # 9.9 m long, its median is short
    assert SkeletonDrawing(document, document.robots[0]).radius == pytest.approx(0.002 * 9.9)


# --- skeleton colours -------------------------------------------------------------------------------------------------
# Colours of links: people with any colour vision distinguish branches, and none looks like a status of the page.
#
# Colour vision is simulated by the matrices of Machado, Oliveira and Fernandes, "A physiologically-based model for
# simulation of color vision deficiency" (2009), severity 1.0; differences are CIE 1976, where 2.3 is just noticeable.


NORMAL = np.eye(3)
DEFICIENT = {
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
WHITE = np.array([0.95047, 1.0, 1.08883])


def lab(colour, vision=NORMAL):
    """CIE L*a*b* (3,) of an sRGB colour as somebody sees it."""
    value = np.asarray(colour, dtype=float)
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    xyz = TO_XYZ @ np.clip(np.asarray(vision) @ linear, 0.0, 1.0) / WHITE
    x, y, z = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("vision", [NORMAL, *DEFICIENT.values()], ids=["normal", *DEFICIENT])
def test_branches_are_distinguished(vision):
    for hue, other in combinations([*BRANCHES, BASE, JOINT, SHARED], 2):
        assert np.linalg.norm(lab(hue, vision) - lab(other, vision)) > (0.0 if {hue, other} == {BASE, JOINT} else 15.0)
