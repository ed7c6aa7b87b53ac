"""Design sweeps: variants are RAFF files, their figures are true, and a folder is gone on with or refused."""

import csv
import io
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mapped import over
from small_robots import four_bar, two_bars

import cinegen
import raff2urdf
from cinegen.plotting.sweep import draw_sweep
from cinegen.workspace import MapError, MapSpecification, make_map, open_map
from cinegen.workspace.sweep import SweptParameter, Variation, WantedBox, sweep, variants
from cinegen.workspace.sweep.box import BoxConfigurations, dexterity, regularity
from cinegen.workspace.sweep.variants import KLEINFINGER


def arm_within(limit: int) -> str:
    """A planar arm with links of 400 and 250 mm."""
    return two_bars((20, 60), (400, 250), (f"limits {{ -{limit} {limit} }}", "velocity 90"))


@pytest.fixture
def arm(text_file):
    """The path of an arm."""
    return text_file("arm.raff", arm_within(180))


def square(half, count):
    return over(("x", -half, half, count), ("y", -half, half, count))


def parse(*texts):
    return [Variation.parse(text) for text in texts]


# --- words ------------------------------------------------------------------------------------------------------------

numbers = st.floats(-1e4, 1e4).map(lambda value: float(f"{value:.9g}"))


@given(numbers, numbers, st.integers(2, 40), st.sampled_from(["link2.d", "tool.theta+-link2.r", "link3.limits.low"]))
def test_a_variation_is_read_as_it_is_written(low, high, count, names):
    if abs(high - low) < 1e-3:
        return
    variation = Variation(tuple(map(SweptParameter.parse, names.split("+"))), low, high, count)
    assert Variation.parse(str(variation)) == variation
    assert variation.heading == names
    assert variation.values == pytest.approx([low + k * (high - low) / (count - 1) for k in range(count)], abs=1e-6)


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (["link2.d"], "has no values"),
        (["link2.d=100..200"], "lacks the number of values: write for instance link2.d=100..200:5"),
        (["link2.d=100..200:0"], "0 values"),
        (["link2.d=long"], "'long' is not a number"),
        (["link2.alfa=1..2:2"], "did you mean 'alpha'"),
        (["link2.d+link2.d=1..2:2"], "named twice"),
        (["link7.d=1..2:2"], "no link or frame 'link7'.*did you mean 'link"),
        (["link2.limits.low=1..2:2"], "link2 has no limits"),
        (["tool.velocity=1..2:2"], "tool does not move"),
        (["link1.limits.low=170..190:2"], "link1.limits.low=190: this is no robot: .*above its upper limit"),
        (["link2.d=1..2:2", "link2.d=3..4:2"], r"link2\.d is varied twice"),
        (["link2.d=1..2:1000", "tool.d=3..4:1000"], "1000000 variants"),
        ([], "at least one parameter"),
    ],
)
def test_what_makes_no_variation_of_the_robot_is_said(arm, texts, words):
    with pytest.raises(MapError, match=words):
        variants(raff2urdf.load(arm), parse(*texts))


# --- variants ---------------------------------------------------------------------------------------------------------


@given(st.data())
def test_a_variant_is_a_raff_file_that_says_the_values_and_else_the_same(robot, root, data):
    document = raff2urdf.load(root / "robots" / f"{data.draw(st.sampled_from(['delta4', 'gough', 'rx90']))}.raff")
    part = data.draw(st.sampled_from([document.robot().base, *document.robot().parts]))
    name, low = data.draw(st.sampled_from(KLEINFINGER)), data.draw(numbers)
    opposite = data.draw(st.booleans())
    swept = variants(document, [Variation((SweptParameter(part.node, name, opposite),), low, low + 90.0, 3)])
    assert len({variant.name for variant in swept}) == 3
    for variant in swept:
        (value,) = variant.values.values()
        reread = raff2urdf.loads(variant.raff())
        assert reread == variant.document
        changed = reread.robot().nodes[part.number]
        assert getattr(changed.parameters, name) == (-value if opposite else value)
        back = replace(changed, parameters=part.parameters)
        parts = tuple(back if node is changed else node for node in reread.robot().parts)
        base = back if part.number == 0 else reread.robot().base
        assert replace(reread, robots=(replace(reread.robot(), base=base, parts=parts),)) == document


def test_parameters_that_are_joined_vary_together_and_others_in_all_combinations(arm):
    swept = variants(raff2urdf.load(arm), parse("link2.d+tool.d+-frame3.r=100..200:2", "link1.limits.high=90..170:3"))
    assert len(swept) == 6
    for variant in swept:
        nodes = variant.document.robot().nodes
        length, limit = variant.values.values()
        assert [nodes[2].parameters.d, nodes[3].parameters.d, nodes[3].parameters.r] == [length, length, -length]
        assert nodes[1].limits == (-180.0, limit)
        assert nodes[2].velocity == 90.0
    assert swept[1].name == "link2.d+tool.d+-frame3.r=100,link1.limits.high=130"


# --- figures ----------------------------------------------------------------------------------------------------------


def test_a_planar_arm_reaches_an_annulus_and_moves_as_known(arm, tmp_path):
    table = sweep(arm, parse("tool.d=150..350:3"), square(0.8, 48), tmp_path / "out", workers=1)
    for row, d in zip(table.rows, (0.15, 0.25, 0.35), strict=True):
        assert row.values == {"tool.d": 1000 * d}
        area = 4.0 * math.pi * 0.4 * d  # pi (sum^2 - difference^2)
        assert abs(row.extent.value - area) <= row.extent.error < 0.3 * area
        assert not row.covers_box
        assert row.dexterity.reached == pytest.approx(row.extent.value / 1.6**2)
        # A configuration's condition, from its Jacobian by hand (Salisbury and Craig's example).
        dataset = open_map(tmp_path / "out" / row.name / "map.zarr")
        q = dataset.configuration.values[dataset.reachable.values]
        s1, c1, s2, c2 = np.sin(q[:, 0]), np.cos(q[:, 0]), np.sin(q.sum(axis=1)), np.cos(q.sum(axis=1))
        jacobians = np.array([[-0.4 * s1 - d * s2, -d * s2], [0.4 * c1 + d * c2, d * c2]]).transpose(2, 0, 1)
        values = np.linalg.svd(jacobians, compute_uv=False)
        conditioning = values[:, 1] / values[:, 0]
        assert row.dexterity.conditioning.worst == pytest.approx(conditioning.min(), rel=1e-4)
        assert row.dexterity.conditioning.mean == pytest.approx(conditioning.mean(), rel=1e-4)
        assert row.dexterity.sigma_1.mean * row.length == pytest.approx(values[:, 1].mean(), rel=1e-4)
        assert row.dexterity.sigma_2 == math.inf
    assert [row.extent.unit for row in table.rows] == ["m^2"] * 3


@pytest.fixture(scope="module")
def coarse(tmp_path_factory):
    """A specification of the planar arm in few cells, and the configurations of its map."""
    region = over(("x", 0.2, 0.7, 5), ("y", -0.4, 0.4, 6))
    spec = MapSpecification(cinegen.load(arm_within(180)), region, ("sigma_1",))
    return spec, make_map(spec, tmp_path_factory.mktemp("coarse") / "map.zarr", workers=1).configuration.values


@given(st.floats(0.2, 0.65), st.floats(-0.4, 0.35), st.floats(0.01, 0.3), st.floats(0.01, 0.3))
def test_a_box_is_reached_as_far_as_its_far_corners_are(coarse, x, y, wide, high):
    spec, q = coarse
    box = WantedBox({"x": (x, min(x + wide, 0.7)), "y": (y, min(y + high, 0.4))})
    grid = box.grid(spec.region)
    far = math.hypot(box.ranges["x"][1], max(map(abs, box.ranges["y"])))
    if abs(far - 0.65) < 1e-3:  # just stretched
        return
    touched = q[grid.cells]
    field = BoxConfigurations(spec, grid, touched)
    if far > 0.65:
        assert not field.reached.all()
    elif np.isfinite(touched).all():
        assert field.reached.all()
        assert regularity(field)
    numbers = dexterity(field)
    assert numbers.whole == field.reached.all()
    assert not numbers.whole or numbers.reached == 1.0


# --- singularities between samples ------------------------------------------------------------------------------------


def test_motors_lose_hold_of_a_five_bar_where_its_outer_bars_are_in_line(robot, tmp_path):
    """Boxes of a few cells, here and there: seen is what the sign of the sine says, though no sample is singular."""
    region = over(("x", -0.3, 0.3, 28), ("y", -0.6, 0.6, 28))
    spec = MapSpecification(robot("five_bar"), region, limits=False)
    dataset = make_map(spec, tmp_path / "map.zarr", workers=1)
    q, sure = dataset.configuration.values, 0
    assert dataset.sigma_2.min() > 1e-6
    for i, k in np.ndindex(9, 9):
        cells = (slice(3 * i, 3 * i + 4), slice(3 * k, 3 * k + 4))
        if not np.isfinite(q[cells]).all():
            continue
        borders = (axis.borders[part.start : part.stop + 1] for axis, part in zip(region.axes, cells, strict=True))
        box = WantedBox({name: (at[0], at[-1]) for name, at in zip("xy", borders, strict=True)})
        field = BoxConfigurations(spec, box.grid(region), q[cells])
        result = regularity(field)
        if not result.joined or result.first:
            continue
        signs = np.sign(np.sin(field.q[field.reached] @ [1.0, 1.0, -1.0, -1.0, *[0.0] * (q.shape[-1] - 4)]))
        assert result.second == (signs.min() < signs.max())
        sure += 1 + 100 * result.second
    assert sure > 120  # both were among them


# --- loops that don't close -------------------------------------------------------------------------------------------


def test_variants_whose_loops_can_not_be_closed_are_told_and_passed_over(text_file, tmp_path):
    path = text_file("bars.raff", four_bar((70, -60, 70), (100, 300, 300, 100), ("actuated 1", "", "")))
    said, lengths = [], parse("link3.d=200..800:4")
    region = over(("joint1", math.radians(60), math.radians(80), 8))
    table = sweep(path, lengths, region, tmp_path / "out", workers=1, report=lambda *done: said.append(done))
    closed = [d <= 500.0 for d in (200.0, 400.0, 600.0, 800.0)]  # the longest bar against the others
    assert [row.dexterity is not None for row in table.rows] == closed
    assert "the mechanism can't be closed: these loops remain open: 'frame4-frame5'" in table.rows[-1].remark
    assert "\n" not in table.rows[-1].remark
    assert not table.rows[-1].suitable
    assert said[-1] == (32, 32)
    assert "'frame4-frame5'" in table.text().splitlines()[-1]
    rows = list(csv.DictReader(io.StringIO((tmp_path / "out" / "table.csv").read_text())))
    assert [bool(row["extent"]) for row in rows] == closed
    assert json.loads(json.dumps(table.as_dict()))["rows"][-1]["extent"] is None
    draw_sweep(table)


# --- the folder -------------------------------------------------------------------------------------------------------


def test_a_sweep_goes_on_and_its_variants_can_be_loaded(arm, tmp_path):
    out, over = tmp_path / "out", parse("link2.d=300..400:2", "tool.d=200..250:2")
    first = sweep(arm, over, square(0.7, 12), out, workers=1)
    expected = ["sweep.json", "table.csv", *(row.name for row in first.rows)]
    assert sorted(path.name for path in out.iterdir()) == sorted(expected)
    written = {path: path.stat().st_mtime_ns for path in out.rglob("map.zarr/status/c.*")}
    assert len(written) >= 4
    for row in first.rows:
        nodes = raff2urdf.load(out / row.name / "robot.raff").robot().nodes
        assert (nodes[2].parameters.d, nodes[3].parameters.d) == tuple(row.values.values())
    text = (out / "table.csv").read_bytes()
    for path in (out / first.rows[2].name / "map.zarr" / "status").glob("c.*"):
        path.unlink()  # as if it had been stopped there
    (out / "table.csv").unlink()
    assert sweep(arm, over, square(0.7, 12), out, workers=1) == first
    assert (out / "table.csv").read_bytes() == text
    kept = {path: path.stat().st_mtime_ns for path in out.rglob("map.zarr/status/c.*")}
    assert {path.parents[2].name for path in written if kept[path] != written[path]} == {first.rows[2].name}
    other = sweep(arm, over, square(0.7, 12), out, box=WantedBox({"x": (0.5, 0.55), "y": (0.0, 0.1)}), workers=1)
    assert [row.extent for row in other.rows] == [row.extent for row in first.rows]
    assert [row.covers_box for row in other.rows] == [False, False, True, True]  # its far corners are at 559 mm
    assert other.suitable == other.rows[2:]


def test_a_folder_of_something_else_is_refused_and_left_alone(arm, tmp_path):
    out, over = tmp_path / "out", parse("link2.d=300..400:2")
    sweep(arm, over, square(0.7, 6), out, workers=1)
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    for call, words in (
        (lambda: sweep(arm, parse("link2.d=300..500:2"), square(0.7, 6), out), r"varied .*300\.\.400:2.*300\.\.500:2"),
        (lambda: sweep(arm, over, square(0.7, 7), out), "another sweep, which differs in region"),
        (lambda: sweep(arm, over, square(0.7, 6), out, limits=False), "differs in settings"),
    ):
        with pytest.raises(MapError, match=words):
            call()
    arm.write_text(arm_within(90), encoding="utf-8")
    with pytest.raises(MapError, match="differs in the RAFF file"):
        sweep(arm, over, square(0.7, 6), out)
    assert before == {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    with pytest.raises(MapError, match="something other than a sweep"):
        sweep(arm, over, square(0.7, 6), tmp_path / "mine")
    (out / "sweep.json").write_text("{broken")
    with pytest.raises(MapError, match="can't be resumed"):
        sweep(arm, over, square(0.7, 6), out)
    with pytest.raises(MapError, match=r"can't be (written|resumed)"):
        sweep(arm, over, square(0.7, 6), arm)


def test_what_was_changed_by_hand_is_kept(arm, tmp_path):
    out, over = tmp_path / "out", parse("link2.d=300..400:2")
    again = lambda: sweep(arm, over, square(0.7, 6), out, workers=1)  # noqa: E731
    first = again()
    robot, table = out / first.rows[0].name / "robot.raff", out / "table.csv"
    for path in (robot, table):
        made = path.read_bytes()
        path.write_bytes(made.replace(b"\r\n", b"\n").replace(b"\n", b"\r\n"))
        assert again() == first
        path.write_bytes(edited := made.replace(b"300", b"301", 1))
        with pytest.raises(MapError, match=rf"{path.name}: was changed by hand"):
            again()
        assert path.read_bytes() == edited
        path.unlink()  # as the message proposes: rename it, or remove it
        assert again() == first
        assert path.read_bytes() == made
