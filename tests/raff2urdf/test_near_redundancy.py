"""Loops that are redundant but for rounded numbers: they are recognised, and healed or relaxed."""

import json
import re
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import mechanisms
import numpy as np
import pinocchio as pin
import pytest
from rounding import largest_change, rounded, walker

import cinegen
import raff2urdf
from cinegen.ik.step import Status
from cinegen.loops.clusters import subsystems
from cinegen.model.build import build
from cinegen.model.healing.heal import by_geometry, moved, twists_of
from cinegen.model.healing.heal_file import heal_file
from cinegen.model.healing.intended import errors, relations
from raff2urdf.closure import closed_walk, rank
from raff2urdf.conversion import describe
from raff2urdf.loops.near_redundancy import near_redundancy, settle
from raff2urdf.readers.written_numbers import adjustables, rewritten

LEGS = ("lower_0+1", "lower_0-1", "lower_1+1", "lower_1-1")

EXACT = {  # text, mobility
    "four_bar": (mechanisms.four_bar(2), 1),
    "parallelogram": (mechanisms.parallelogram(), 1),
    "flat parallelogram": (mechanisms.parallelogram(3, lean=0.0), 1),
    "hexagon": (mechanisms.polygon(6, 2), 3),
    "3rrr": (mechanisms.planar_3rrr(), 3),
    "sarrus": (mechanisms.sarrus(2), 1),
    "sarrus_rigid": (mechanisms.sarrus(how="rigid"), 1),
    "bennett": (mechanisms.bennett(), 1),
}


def described(text):
    document = raff2urdf.loads(text)
    return describe(document, document.robot(None), Path())


@pytest.fixture(scope="module")
def walkers(tmp_path_factory):
    """`walker` as it is healed, relaxed, and as written; and what is said of the first."""
    path = tmp_path_factory.mktemp("walker") / "walker.sdf"
    path.write_text(walker())
    with pytest.warns(cinegen.CinegenWarning, match="nearly redundant") as warned:
        healed = cinegen.load(path)
    with pytest.warns(cinegen.CinegenWarning, match="nearly redundant"):
        relaxed = cinegen.load(path, relax=True)
    return healed, relaxed, cinegen.load(path, relax=False), [str(warning.message) for warning in warned]


def dragged(mechanism, nodes, ticks, size, seed=0, hold=25):
    """Statuses and the largest closure while nodes follow random targets around where they are at home."""
    solver, rng = cinegen.Solver(mechanism, dt=0.001), np.random.default_rng(seed)
    tasks = [solver.add_task(node) for node in nodes]
    homes = [pin.SE3(task.target) for task in tasks]
    statuses, closure = Counter(), 0.0
    for k in range(ticks):
        if k % hold == 0:
            for task, home in zip(tasks, homes, strict=True):
                target = pin.SE3(home)
                target.translation = target.translation + size * rng.normal(size=3)
                task.target = target
        step = solver.step()
        statuses[step.status] += 1
        closure = max(closure, step.closure)
    return statuses, closure


def test_legs_whose_hips_are_tilted_by_rounding_are_healed_or_relaxed(walkers):
    healed, relaxed, written, (message,) = walkers
    assert [f"loop 'foot_{leg}' (revolute) by 0.00" in message for leg in (0, 1)] == [True, True]
    assert message.count("mm and") == 4
    assert message.count("healed: placements changed by up to") == 2
    assert healed.mobility == 2 * 2  # 6 joints a leg; of its five rows, the one along the hinge is redundant
    assert set(healed.actuated) == {"hip_0+1", "hip_0-1", "hip_1+1", "hip_1-1"}
    assert {loop.kind.name for loop in healed.loops} == {"REVOLUTE"}
    for system, at in subsystems(healed.structure.own_system()):
        assert near_redundancy(system, healed.q_home[at]) is None
    assert {loop.kind.name for loop in relaxed.loops} == {"BALL"}
    assert relaxed.mobility == 2 * 3  # of each leg's six joints three are determined: the knees are universal joints
    assert written.mobility < 4  # as written nearly nothing moves
    assert dragged(written, LEGS, 100, 0.1)[0][Status.FOLLOWING] == 0
    for mechanism in (healed, relaxed):
        statuses, closure = dragged(mechanism, LEGS, 1000, 0.1)
        assert statuses[Status.FOLLOWING] > 300
        assert statuses[Status.REFUSED] == 0
        assert closure <= 1e-10


@pytest.mark.parametrize(("name", "digits"), [("four_bar", 3), ("3rrr", 4), ("sarrus", 6), ("bennett", 3)])
def test_rounded_mechanisms_are_healed(name, digits, recwarn):
    text, mobility = EXACT[name]
    written = rounded(*described(text), digits, 1)
    with pytest.warns(cinegen.CinegenWarning, match="pins with play" if name == "four_bar" else "healed"):
        mechanism = build(*written, relax=None)
    assert mechanism.mobility == mobility
    assert largest_change(written[0], mechanism.source.urdf) < 4.0 * 10.0**-digits
    statuses, closure = dragged(mechanism, [mechanism.end], 300, 0.1 * mechanism.length, 1)
    assert statuses[Status.REFUSED] == 0
    assert closure <= 1e-10


@pytest.mark.parametrize("name", EXACT)
def test_exact_mechanisms_stay_as_they_are(name, recwarn):
    urdf, constraints = described(EXACT[name][0])
    mechanism = build(urdf, constraints, relax=None)
    assert (mechanism.source.urdf, mechanism.mobility) == (urdf, EXACT[name][1])
    assert not [warning for warning in recwarn if "redundant" in str(warning.message)]


def test_raff2urdf_heals_as_load_does_and_what_it_writes_is_exact(tmp_path):
    text, mobility = EXACT["bennett"]
    path = tmp_path / "rounded.raff"
    tilted = re.sub(r"(?<=alpha )\S+(?=.*pred 2)", lambda alpha: repr(float(alpha[0]) + 1e-4), text, count=1)
    path.write_text(tilted, encoding="utf-8")
    with pytest.warns(cinegen.CinegenWarning, match="healed") as warned:
        loaded = cinegen.load(path)
    with pytest.warns(cinegen.CinegenWarning, match="healed") as said:
        (made,) = raff2urdf.convert(path, tmp_path)
    assert [str(warning.message) for warning in said] == [str(warning.message) for warning in warned]
    assert made.analysis.mobility == loaded.mobility == mobility
    assert made.analysis.actuated == loaded.actuated
    again = cinegen.load(made.file)  # without a warning
    assert again.mobility == mobility
    for node in loaded.nodes:
        apart = again.placement(again.q_home, node).actInv(loaded.placement(loaded.q_home, node))
        np.testing.assert_allclose(apart.homogeneous, np.eye(4), atol=1e-9)


def test_a_gap_that_is_no_rounding_is_an_error():
    urdf, constraints = described(mechanisms.four_bar(2))
    constraints["loops"][0]["first"]["placement"][2][3] += 0.1
    with pytest.raises(cinegen.ClosureError):
        build(urdf, constraints, relax=None)


@pytest.mark.parametrize("name", ["sarrus", "3rrr", "bennett"])
def test_derivatives_by_the_geometry_are_those_of_differences(name):
    mechanism = build(*described(EXACT[name][0]))
    system, rng = mechanism.structure.own_system(), np.random.default_rng(0)
    count, twists = mechanism.model.njoints - 1, twists_of(system)
    step = 1e-6 * rng.normal(size=(twists, 6))
    step[count : 2 * count] = 0.0  # bodies behind joints: `moved` leaves them
    q = system.integrate(mechanism.q_home, 0.1 * rng.normal(size=mechanism.model.nv))
    ahead, back = moved(system, step.ravel()), moved(system, -step.ravel())
    system.evaluate(q)
    change = (ahead.evaluate(q)[0] - back.evaluate(q)[0]) / 2.0
    np.testing.assert_allclose(by_geometry(system) @ step.ravel(), change, atol=1e-11)
    wanted = relations(system)
    change = (errors(ahead, wanted, twists)[0] - errors(back, wanted, twists)[0]) / 2.0
    np.testing.assert_allclose(errors(system, wanted, twists)[1] @ step.ravel(), change, atol=1e-11)


def test_loops_that_no_joint_can_open_are_not_nearly_redundant():
    rigid = SimpleNamespace(evaluate=lambda q: (np.zeros(6), np.zeros((6, len(q)))), integrate=np.add)
    assert near_redundancy(rigid, np.zeros(0)) is None
    assert near_redundancy(rigid, np.zeros(2)) is None


def test_equations_that_can_not_be_solved_are_given_up_soon():
    """No point of one of these circles is on the other."""
    circles = mechanisms.Circles(2.1)
    assert settle(circles, np.array([0.3, -0.2]), 1e-6) is None
    assert circles.evaluations < 25


# --- heal -------------------------------------------------------------------------------------------------------------
# Files of all formats are healed: numbers change by less than they were rounded, and everything else stays.


def written(healing, folder: Path) -> list[Path]:
    folder.mkdir()
    for path, content in healing.contents.items():
        (folder / path.name).write_bytes(content)
    return [folder / path.name for path in healing.contents]


def check_numbers(path, healing, digits):
    """Changes are of the size of rounding, and all that differs."""
    assert healing.numbers
    assert max(abs(edit.change) for edit in healing.numbers) < 4.0 * 10.0**-digits
    for file, content in healing.contents.items():
        before, after = file.read_bytes().split(b"\n"), content.split(b"\n")
        pairs = enumerate(zip(before, after, strict=True), 1)
        lines = {k for k, (old, new) in pairs if old != new and b'"urdf_sha256"' not in new}
        assert lines == {edit.number.line for edit in healing.numbers if edit.number.file == file}


def test_an_sdf_whose_hips_are_tilted_is_healed(tmp_path, text_file):
    path = text_file("walker.sdf", walker(legs=1, tilt=4e-5))
    healing = heal_file(path)
    tilts = [edit for edit in healing.numbers if abs(float(edit.number.text)) == 4e-5]
    assert len(tilts) == 2
    assert all(abs(edit.value) < 1e-11 for edit in tilts)
    assert max(abs(edit.change) for edit in healing.numbers) < 4.1e-5
    check_numbers(path, healing, 4)
    mechanism = cinegen.load(written(healing, tmp_path / "out")[0])  # without a warning
    assert {loop.kind.name for loop in mechanism.loops} == {"REVOLUTE"}
    assert mechanism.mobility == 2
    for system, at in subsystems(mechanism.structure.own_system()):
        for q in closed_walk(system, mechanism.q_home[at], 20):
            assert rank(system.evaluate(q)[1]) <= 4
            assert abs(system.evaluate(q)[0]).max() <= 1e-12


def test_a_urdf_with_its_constraints(tmp_path, text_file):
    exact = build(*described(mechanisms.four_bar(2)))
    urdf, constraints = rounded(exact.source.urdf, exact.source.constraints, 5, 1)
    path = text_file("rounded.urdf", urdf)
    path.with_suffix(".constraints.json").write_text(json.dumps(constraints, indent=1))
    healing = heal_file(path)
    check_numbers(path, healing, 5)
    assert cinegen.load(written(healing, tmp_path / "out")[0]).mobility == 1


def test_bennett_as_mjcf(tmp_path, text_file):
    (conversion,) = raff2urdf.convert(text_file("source.raff", mechanisms.bennett()), out=tmp_path, format="mjcf")
    number = re.compile(r"(?<=[\s>\"'])-?\d+\.\d+(e-?\d+)?")
    text = number.sub(lambda match: repr(round(float(match[0]), 5)), conversion.file.read_text())
    path = text_file("rounded.xml", text)
    healing = heal_file(path)
    check_numbers(path, healing, 4)
    mechanism = cinegen.load(written(healing, tmp_path / "out")[0])
    assert (mechanism.mobility, {loop.kind.name for loop in mechanism.loops}) == (1, {"REVOLUTE"})


@pytest.mark.parametrize("name", ["delta4", "gough", "four_bar"])
def test_numbers_that_do_not_change_are_written_as_they_were(name, root):
    path = root / f"robots/{name}.raff"
    numbers = [number for group in adjustables(path) for number in group.numbers]
    assert len(numbers) > 5
    (content,) = rewritten(numbers, [number.value for number in numbers]).values()
    assert content == path.read_bytes()
