"""Masses in RAFF: stated in the file's units, or of a density; wrong ones are refused with their place."""

import math
import warnings
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh

import cinegen
from raff2urdf import RaffError, RaffWarning, check
from raff2urdf.raff.document import RaffInertial
from raff2urdf.raff.reader import loads, parse
from raff2urdf.raff.sizes import check_sizes
from raff2urdf.raff.writer import dumps


def robot(inertial: str, more: str = "", head: str = "") -> str:
    return f"RAFF a\n{head}\nrobot r {{\n  link 1 {{ type 2 pred 0 {inertial} }}\n  {more}\n}}\n"


def loaded(tmp_path: Path, text: str) -> cinegen.Mechanism:
    path = tmp_path / "a.raff"
    path.write_text(text)
    return cinegen.load(path)


def checked(text: str) -> None:
    document = parse(text, "a")
    check(document)
    check_sizes(document, document.robots[0])


def body(mechanism: cinegen.Mechanism, joint: str = "joint1") -> pin.Inertia:
    return mechanism.model.inertias[mechanism.model.getJointId(joint)]


IN_MM = "inertial { mass 2 centre { 10 20 30 } moments { 4000 5000 6000 } products { 100 -200 300 } }"
IN_M = "inertial { mass 2 centre { 0.01 0.02 0.03 } moments { 4e-3 5e-3 6e-3 } products { 1e-4 -2e-4 3e-4 } }"


@pytest.mark.parametrize(("text", "head"), [(IN_MM, ""), (IN_M, "units m")])
def test_moments_are_in_kg_and_the_files_unit_of_length(tmp_path: Path, text: str, head: str) -> None:
    found = body(loaded(tmp_path, robot(text, head=head)))
    assert found.mass == 2.0
    np.testing.assert_allclose(found.lever, [0.01, 0.02, 0.03], rtol=1e-15)
    expected = [[4e-3, 1e-4, -2e-4], [1e-4, 5e-3, 3e-4], [-2e-4, 3e-4, 6e-3]]
    np.testing.assert_allclose(found.inertia, expected, rtol=1e-14)


@pytest.mark.parametrize("text", [IN_MM, "inertial { mass 0 }", "inertial { density 2700 radius 5 }"])
def test_inertials_are_written_as_they_were_read(text: str) -> None:
    frame = f'frame 2 {{ pred 1 parameters {{ d 100 }} {text} }} base {{ filename {{ "a.stl" }} {text} }}'
    document = loads(robot(text, frame))
    assert loads(dumps(document)) == document
    assert all(isinstance(node.inertial, RaffInertial) for node in document.robots[0].nodes.values())


def test_a_body_has_the_sum_of_its_nodes(tmp_path: Path) -> None:
    more = "frame 2 { pred 1 parameters { d 300 } inertial { mass 1 } }\n"
    more += "link 3 { type 0 pred 2 parameters { r 200 } inertial { mass 4 moments { 10 10 10 } } }"
    mechanism = loaded(tmp_path, robot("inertial { mass 2 }", more))
    assert mechanism.massless == ()
    points = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.0, 0.2]])
    masses = np.array([2.0, 1.0, 4.0])
    centre = masses @ points / 7.0
    second = (points - centre).T @ np.diag(masses) @ (points - centre)
    found = body(mechanism)
    np.testing.assert_allclose(found.lever, centre, rtol=1e-14)
    np.testing.assert_allclose(found.inertia, np.trace(second) * np.eye(3) - second + 1e-5 * np.eye(3), atol=1e-15)


@pytest.mark.parametrize("kind", ["ball", "universal", "cylindrical", "planar"])
def test_a_joint_of_several_variables_moves_the_mass_by_all_of_them(tmp_path: Path, kind: str) -> None:
    more = f"link 2 {{ joint {kind} pred 1 parameters {{ d 100 }} inertial {{ mass 5 centre {{ 7 8 9 }} }} }}"
    mechanism = loaded(tmp_path, robot("inertial { mass 2 }", more))
    assert mechanism.massless == ()
    node = mechanism.model.frames[mechanism.frame_id("link2")].parentJoint
    assert [inertia.mass for inertia in mechanism.model.inertias if inertia.mass > 0.0] == [2.0, 5.0]
    assert mechanism.model.inertias[node].mass == 5.0


# --- densities -----------------------------------------------------------------------------------------------------


def test_bars_run_along_epsilon_d_and_r_of_the_children(tmp_path: Path) -> None:
    more = "link 2 { type 2 pred 1 parameters { epsilon 30 d 200 r 100 alpha 90 } }"
    found = body(loaded(tmp_path, robot("inertial { density 7850 radius 6 }", more)))
    per_length = 7850.0 * math.pi * 0.006**2
    lengths = np.array([0.03, 0.2, 0.1])
    middles = np.array([[0.0, 0.0, 0.015], [0.1, 0.0, 0.03], [0.2, -0.05, 0.03]])
    assert found.mass == pytest.approx(per_length * 0.33, rel=1e-8)
    np.testing.assert_allclose(found.lever, lengths @ middles / 0.33, atol=1e-9)
    corners = [(0, 0, 0), (0, 0, 0.03), (0.2, 0, 0.03), (0.2, -0.1, 0.03)]
    bars = [trimesh.creation.cylinder(0.006, segment=s, sections=400) for s in pairwise(corners)]
    whole = trimesh.util.concatenate(bars)
    whole.density = 7850.0
    np.testing.assert_allclose(found.inertia, whole.moment_inertia, rtol=2e-3, atol=1e-8)


@pytest.mark.parametrize("ending", ["stl", "obj", "glb", "ply"])
def test_a_density_counts_for_the_volume_of_the_graphics(tmp_path: Path, ending: str) -> None:
    box = trimesh.creation.box((100.0, 60.0, 20.0), transform=trimesh.transformations.translation_matrix((50, 0, 0)))
    box.export(tmp_path / f"box.{ending}")
    found = body(loaded(tmp_path, robot(f'inertial {{ density 2700 }} filename {{ "box.{ending}" }}')))
    mass = 2700.0 * 0.1 * 0.06 * 0.02
    assert found.mass == pytest.approx(mass, rel=1e-6)
    np.testing.assert_allclose(found.lever, [0.05, 0.0, 0.0], atol=1e-9)
    expected = mass / 12.0 * np.array([0.06**2 + 0.02**2, 0.1**2 + 0.02**2, 0.1**2 + 0.06**2])
    np.testing.assert_allclose(found.inertia, np.diag(expected), rtol=1e-6, atol=1e-12)


def test_of_an_open_surface_the_hull_counts_and_a_warning_names_the_file(tmp_path: Path) -> None:
    box = trimesh.creation.box((100.0, 60.0, 20.0))
    trimesh.Trimesh(box.vertices, box.faces[2:]).export(tmp_path / "open.stl")
    with pytest.warns(RaffWarning, match=r"a.raff:4:45: the graphics 'open.stl' of link 1 enclose no volume: .* hull"):
        found = body(loaded(tmp_path, robot('inertial { density 1000 } filename { "open.stl" }')))
    assert found.mass == pytest.approx(0.12, rel=1e-6)


@pytest.mark.parametrize(("text", "why"), [
    ('inertial { density 3 } filename { "flat.stl" }', "but graphics that enclose no volume: give its 'mass'"),
])  # fmt: skip
def test_a_density_without_a_volume_is_refused(tmp_path: Path, text: str, why: str) -> None:
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]])
    flat.export(tmp_path / "flat.stl")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of graphics that can't be shown
        with pytest.raises(RaffError, match=rf"a.raff:4:.*{why}"):
            loaded(tmp_path, robot(text))


# --- wrong ones ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("text", "why"), [
    ("inertial { mass -1 }", "a:4:42: the mass of link 1 is -1 kg: it must not be negative"),
    ("inertial { mass 1kg }",
     r"'mass' needs a number, and '1kg' is not one: write 1 \(numbers have no unit: .* masses in kg"),
    ("inertial { density 0 radius 1 }", "the density of link 1 is 0: it must be above 0"),
    ("mass 1", r"'mass' does not belong in link 1, but in 'inertial \{ \}'"),
    ("inertial { mass 1e13 }", r"'mass' of the inertial of link 1 is beyond 1e\+12 in SI units"),
])  # fmt: skip
def test_a_wrong_inertial_is_refused_with_its_place(text: str, why: str) -> None:
    with pytest.raises(RaffError, match=why):
        checked(robot(text))


def test_an_inertia_that_no_body_has_is_a_warning_and_is_kept(tmp_path: Path) -> None:
    text = robot("inertial { mass 1 moments { 1 1 3 } }")
    with pytest.warns(RaffWarning, match=r"a.raff:4:54: no body can have the inertia of link 1: .* exceeds the sum"):
        mechanism = loaded(tmp_path, text)
    assert list(mechanism.unphysical) == ["link1"]
    assert body(mechanism).inertia[2, 2] == pytest.approx(3e-6)
