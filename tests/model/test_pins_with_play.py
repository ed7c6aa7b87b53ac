"""Planar loops whose pins are apart along their axes: closed in the plane, or told with the edit that closes them."""

import re

import pytest

import cinegen
import raff2urdf
from raff2urdf.loops.mobility import analyse


def bars(gap: float, kind: int = 2, turned: str = "", end: str = "frame 5") -> str:
    """A four-bar whose rocker is higher by a gap, mm."""
    return f"""RAFF bars
    robot r {{
      link 1 {{ parameters {{ theta 60 }} type 2 pred 0 }}
      link 2 {{ parameters {{ d 100 theta -40 }} type 2 pred 1 }}
      frame 3 {{ parameters {{ d 300 }} pred 2 }}
      link 4 {{ parameters {{ d 300 theta 100 r {gap} }} type 2 pred 0 }}
      frame 5 {{ parameters {{ d 250 {turned} }} pred 4 }}
      constraint {{ frame 3 {end} type {kind} }}
    }}"""


@pytest.mark.parametrize("kind", [2, 3], ids=["revolute", "ball"])
def test_they_are_closed_in_the_plane_with_one_warning(kind):
    """It moves as the four-bar without the gap; raff2urdf warns of the same."""
    plain = cinegen.load(bars(0.0, kind))
    with pytest.warns(
        cinegen.CinegenWarning, match=r"play: 'frame3-frame5' by 0\.45 mm along .* nothing across"
    ) as caught:
        mechanism = cinegen.load(bars(0.45, kind))
    assert len(caught) == 1
    assert mechanism.mobility == plain.mobility == 1
    assert mechanism.q_home == pytest.approx(plain.q_home, abs=1e-12)
    solver = cinegen.Solver(mechanism, dt=0.01)
    task = solver.add_task("link2", rotation=0)
    task.target.translation += [0.02, 0.02, 0.0]
    assert max(abs(solver.step().q - mechanism.q_home)) > 1e-3
    document = raff2urdf.loads(bars(0.45, kind))
    (remark,) = analyse(document, document.robot()).remarks
    assert remark.partition(". --exact")[0] in str(caught[0].message)
    with pytest.raises(raff2urdf.RaffError, match=r"0\.45 mm along"):
        analyse(document, document.robot(), exact=True)


@pytest.mark.parametrize("form", ["urdf", "sdf", "mjcf"])
def test_raff2urdf_writes_them_closed(form, tmp_path):
    (tmp_path / "bars.raff").write_text(bars(0.45), encoding="utf-8")
    with pytest.warns(raff2urdf.RaffWarning, match=r"0\.45 mm along"):
        (made,) = raff2urdf.convert(tmp_path / "bars.raff", tmp_path, format=form)
    assert cinegen.load(made.file, relax=False).mobility == 1


@pytest.mark.parametrize(("gap", "relax"), [(0.45, False), (40.0, None)], ids=["exact", "too much to be play"])
def test_what_is_not_closed_in_the_plane_is_told_with_the_edit_that_does(gap, relax, tmp_path):
    path = tmp_path / "bars.raff"
    path.write_text(bars(gap), encoding="utf-8")
    with pytest.raises(cinegen.ClosureError, match=f"revolute, {gap:g} mm along its axis") as caught:
        cinegen.load(path, relax=relax)
    found = re.search(
        r"no motion changes these gaps\. It closes with a frame on frame5, '(parameters .*)', lengths in mm",
        str(caught.value),
    )
    assert found, caught.value
    mended = bars(gap, end="frame 6").replace("constraint", f"frame 6 {{ {found[1]} pred 5 }}\n constraint")
    assert cinegen.load(mended, relax=False).mobility == 1


def test_an_axis_that_points_the_other_way_and_a_gap_are_mended_together(tmp_path):
    path = tmp_path / "bars.raff"
    path.write_text(bars(30.0, turned="alpha 180"), encoding="utf-8")
    with pytest.raises(cinegen.ClosureError, match="frame3 and frame5 point against each other") as caught:
        cinegen.load(path)
    found = re.search(r"It closes with a frame on frame5, '(parameters .*)', lengths in mm", str(caught.value))
    assert found, caught.value
    mended = bars(30.0, turned="alpha 180", end="frame 6")
    mended = mended.replace("constraint", f"frame 6 {{ {found[1]} pred 5 }}\n constraint")
    assert cinegen.load(mended, relax=False).mobility == 1


def test_links_that_are_too_short_are_no_play():
    """Every motion changes their gap."""
    with pytest.raises(cinegen.ClosureError) as caught:
        cinegen.load(bars(0.0).replace("d 300 }", "d 30 }").replace("d 250", "d 25"))
    assert "no motion changes" not in str(caught.value)
