"""How cells come to their configurations: on home's branch, and none is lost for the way that was taken."""

import numpy as np
import pytest
from mapped import mapped, over
from urdf_text import UrdfJoint, urdf_text

from cinegen.model.build import build
from cinegen.singularities import SingularityType
from cinegen.singularities.crossing import of_node
from cinegen.workspace import MapError, MapSpecification, make_map
from cinegen.workspace.cells import CellStatus
from cinegen.workspace.loci import loci

FLOATING = urdf_text([
    UrdfJoint("free", "world", "base", kind="floating"),
    UrdfJoint("slide", "base", "a", axis="1 0 0", kind="prismatic", limit=(-1.0, 1.0)),
    UrdfJoint("turn", "a", "tool", "0 0 0.3", "0 1 0", limit=(-1.0, 1.0)),
])  # fmt: skip


def test_over_motors_no_cell_is_lost_in_a_pocket_that_the_way_led_into(robot):
    """Each cell on its own straight way from home is the least that a whole piece must hold."""
    axes = (("joint1", -2.5, 2.5, 10), ("joint6", -2.5, 2.5, 10))
    spec = MapSpecification(robot("delta4"), over(*axes), ("sigma_1",))
    together, alone = mapped(spec), mapped(spec, most=1)
    assert (together["reachable"] >= alone["reachable"]).all()
    assert together["reachable"].sum() <= 1.1 * alone["reachable"].sum()
    model, q = robot("delta4").model, together["configuration"][together["reachable"]]
    assert (q >= model.lowerPositionLimit - 1e-8).all()
    assert (q <= model.upperPositionLimit + 1e-8).all()


@pytest.mark.parametrize("count", [35, 36])
def test_a_wave_does_not_change_branches_in_a_cell_where_two_meet(robot, count):
    """With odd counts a cell of this grid is exactly where both arms of the five-bar are folded."""
    five_bar = robot("five_bar")
    region = over(("x", -0.7, 0.7, count), ("y", -0.7, 0.7, count))
    spec = MapSpecification(five_bar, region, ("sigma_1",), limits=False)
    layers = mapped(spec)
    q = layers["configuration"][layers["reachable"] & (layers["sigma_1"] > 1e-3)]
    for joint in ("joint2", "joint4"):
        at = five_bar.q_index(joint)
        assert (np.sign(np.sin(q[:, at])) == np.sign(np.sin(five_bar.q_home[at]))).all()


@pytest.mark.parametrize(("names", "count"), [(("joint1", "joint2"), 20), (("joint2", "joint3"), 21)])
def test_a_curve_on_the_middles_or_the_borders_of_cells_is_one_line(robot, tmp_path, names, count):
    """An arm whose elbow is straight, over a range with that in its middle: at a point of the grid, or between two."""
    spec = MapSpecification(robot("planar_3r"), over(*((name, -1.0, 1.0, count) for name in names)), ("sigma_1",))
    curves = loci(make_map(spec, tmp_path / "map.zarr", workers=1), spec)
    (curve,) = [curve for curve in curves if curve.kind is SingularityType.TYPE_1]
    assert len(curve.points) == count
    np.testing.assert_allclose(curve.points[:, names.index("joint2")], 0.0, atol=1e-6)


def test_a_base_that_floats_rests(tmp_path):
    flying = build(FLOATING, None)
    assert flying.floating
    of_motors = mapped(MapSpecification(flying, over(("slide", -0.5, 0.5, 5), ("turn", -0.5, 0.5, 5)), node="tool"))
    assert np.isfinite(of_motors["sigma_1"]).all()
    region = over(("x", -1.5, 1.5, 9), ("ry", -0.5, 0.5, 3))
    layers = mapped(MapSpecification(flying, region, ("solutions", "sigma_1"), node="tool"))
    within = np.abs(region.axes[0].middles()) <= 1.0
    np.testing.assert_array_equal(layers["solutions"], np.repeat(within[:, None], 3, axis=1).astype(int))
    spec = MapSpecification(flying, over(("slide", -0.5, 0.5, 5), ("turn", -0.5, 0.5, 5)), ("sigma_1",), node="tool")
    assert loci(make_map(spec, tmp_path / "map.zarr", workers=1), spec) == ()
    rows = of_node(flying, "tool", 6)(flying.q_home)
    assert np.linalg.matrix_rank(rows) == 2
    with pytest.raises(MapError, match="can't move along y"):
        MapSpecification(flying, over(("y", -1.0, 1.0, 3)), node="tool")


def test_the_codes_of_stored_maps_stay():
    """Maps on disk hold these numbers."""
    codes = [
        CellStatus.NOT_EVALUATED, CellStatus.REACHABLE, CellStatus.REACHABLE_BY_SEARCH, CellStatus.UNREACHABLE_PROVED,
        CellStatus.UNREACHABLE_NOT_FOUND, CellStatus.LOOPS_OPEN, CellStatus.BEYOND_LIMITS,
    ]  # fmt: skip
    assert [int(code) for code in codes] == list(range(7)) == [int(code) for code in CellStatus]
    assert [code.reachable for code in codes] == [False, True, True, False, False, False, False]
    assert len({code.label for code in codes}) == 7
