"""Files of all formats are healed: numbers change by less than they were rounded, and everything else stays."""

import json
import re
from pathlib import Path

import mechanisms
import pytest
from rounding import rounded, walker
from test_near_redundancy import described

import cinegen
import raff2urdf
from cinegen.loops.clusters import subsystems
from cinegen.model.build import build
from cinegen.model.healing.heal_file import heal_file
from raff2urdf.closure import closed_walk, rank
from raff2urdf.readers.written_numbers import adjustables, rewritten


def written(healing, folder: Path) -> list[Path]:
    folder.mkdir()
    for path, content in healing.contents.items():
        (folder / path.name).write_bytes(content)
    return [folder / path.name for path in healing.contents]


def check_numbers(path, healing, digits):
    """Changes are of the size of rounding, and all that differs."""
    assert healing.numbers
    assert max(abs(one.change) for one in healing.numbers) < 4.0 * 10.0**-digits
    for file, content in healing.contents.items():
        before, after = file.read_bytes().split(b"\n"), content.split(b"\n")
        pairs = enumerate(zip(before, after, strict=True), 1)
        lines = {k for k, (old, new) in pairs if old != new and b'"urdf_sha256"' not in new}
        assert lines == {one.number.line for one in healing.numbers if one.number.file == file}


def test_an_sdf_whose_hips_are_tilted_is_healed(tmp_path):
    path = tmp_path / "walker.sdf"
    path.write_text(walker(legs=1, tilt=4e-5))
    healing = heal_file(path)
    tilts = [one for one in healing.numbers if abs(float(one.number.text)) == 4e-5]
    assert len(tilts) == 2
    assert all(abs(one.value) < 1e-11 for one in tilts)
    assert max(abs(one.change) for one in healing.numbers) < 4.1e-5
    check_numbers(path, healing, 4)
    mechanism = cinegen.load(written(healing, tmp_path / "out")[0])  # without a warning
    assert {loop.kind.name for loop in mechanism.loops} == {"REVOLUTE"}
    assert mechanism.mobility == 2
    for own, at in subsystems(mechanism.structure.own_system()):
        for q in closed_walk(own, mechanism.q_home[at], 20):
            assert rank(own.evaluate(q)[1]) <= 4
            assert abs(own.evaluate(q)[0]).max() <= 1e-12


def test_a_urdf_with_its_constraints(tmp_path):
    exact = build(*described(mechanisms.four_bar(2)))
    urdf, constraints = rounded(exact.source.urdf, exact.source.constraints, 5, 1)
    path = tmp_path / "rounded.urdf"
    path.write_text(urdf)
    path.with_suffix(".constraints.json").write_text(json.dumps(constraints, indent=1))
    healing = heal_file(path)
    check_numbers(path, healing, 5)
    mechanism = cinegen.load(written(healing, tmp_path / "out")[0])
    assert mechanism.mobility == 1


@pytest.mark.parametrize("suffix", [".raff", ".xml"])
def test_bennett_in_each_format(suffix, tmp_path):
    source = tmp_path / "source.raff"
    source.write_text(mechanisms.bennett())
    if suffix != ".raff":
        (conversion,) = raff2urdf.convert(source, out=tmp_path, format="mjcf")
        source = conversion.file
    digits = 2 if suffix == ".raff" else 5  # mm and degrees
    number = re.compile(r"(?<=[\s>\"'])-?\d+\.\d+(e-?\d+)?")
    path = tmp_path / f"rounded{suffix}"
    path.write_text(number.sub(lambda found: repr(round(float(found[0]), digits)), source.read_text()))
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
