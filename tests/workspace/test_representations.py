"""What notebooks and debuggers show of maps' classes is one short line, or a table."""

from folders import over_joints

from cinegen.workspace import make_map
from cinegen.workspace.comparison import compare
from cinegen.workspace.sweep import SweepResult, VariantResult, WantedBox, variants
from cinegen.workspace.sweep.variants import Variation
from raff2urdf import load


def short(thing) -> bool:
    return len(repr(thing)) < 200 and "\n" not in repr(thing)


def test_a_comparison_is_a_line_or_a_table(robot, tmp_path):
    spec = over_joints(robot("planar_3r"))
    dataset = make_map(spec, tmp_path / "map.zarr", workers=1)
    found = compare(dataset, dataset)
    assert all(map(short, (spec, spec.region, found, *found.differences.values())))
    assert all(name in found._repr_html_() for name in (*found.extents, *found.differences))


def test_the_result_of_a_sweep_is_a_line_or_a_table(root):
    document = load(root / "robots/planar_3r.raff")
    found = variants(document, [Variation.parse("link2.d=100..200:3")])
    rows = tuple(VariantResult(one.name, one.values, remark="<not mapped>") for one in found)
    result = SweepResult("planar_3r", "mm", ("link2.d",), WantedBox(), rows)
    assert all(map(short, (result, *rows, *found)))
    assert result._repr_html_().count("<tr>") == 1 + len(rows)
    assert "&lt;not mapped&gt;" in result._repr_html_()
