"""URDFs whose root is not declared, whose trees are joined by loops only, or whose limits are reversed."""

import re

import numpy as np
import pytest

import cinegen
from cinegen.cli import main
from raff2urdf.urdf2raff.cli import main as urdf2raff

TURN = """<joint name="{0}" type="continuous">
  <parent link="{1}"/><child link="{2}"/><origin xyz="{3}"/><axis xyz="0 0 1"/>
</joint>"""
PIN = """<loop_joint name="{0}" type="continuous">
  <link1 link="{1}" xyz="{3}"/><link2 link="{2}" xyz="{4}"/><axis xyz="0 0 1"/>
</loop_joint>"""
LIMITED = """<joint name="j" type="revolute">
  <parent link="a"/><child link="b"/><axis xyz="0 0 1"/><limit {} velocity="1" effort="1"/>
</joint>"""


def links(*names):
    return "".join(f'<link name="{name}"/>' for name in names)


def robot(*elements):
    return f'<robot name="r">{"".join(elements)}</robot>'


@pytest.fixture
def load(tmp_path):
    def load(*elements, **options):
        path = tmp_path / "r.urdf"
        path.write_text(robot(*elements))
        return cinegen.load(path, **options)

    return load


@pytest.mark.parametrize(("kind", "floating"), [("fixed", False), ("floating", True)])
def test_a_world_that_is_not_declared_is_the_base(load, kind, floating):
    joint = f'<joint name="at" type="{kind}"><parent link="world"/><child link="a"/><origin xyz="0 0 1"/></joint>'
    arm = load(links("a", "b"), joint, TURN.format("j", "a", "b", "1 0 0"))
    assert arm.nodes == ("world", "a", "b")
    assert arm.floating == floating
    np.testing.assert_allclose(arm.placement(arm.q_home, "b").translation, [1.0, 0.0, 1.0])
    assert "link 'world' is the parent of a joint, and not declared: it is the base" in arm.source.notes
    declared = load(links("world", "a", "b"), joint, TURN.format("j", "a", "b", "1 0 0"))
    assert declared.nodes == arm.nodes
    assert declared.source.notes == ()


def test_another_parent_that_is_not_declared_is_refused(load):
    with pytest.raises(cinegen.CinegenError, match="'wurld', which is not a link"):
        load(links("a"), TURN.format("j", "wurld", "a", "0 0 0"))


FOUR_BAR = (
    links("ground", "crank", "rocker", "coupler"),
    TURN.format("drive", "ground", "crank", "0 0 0"),
    TURN.format("swing", "ground", "rocker", "0.4 0 0"),
)


@pytest.mark.parametrize("first", ["ground", "coupler"])
def test_a_tree_that_only_loops_join_to_the_base_is_held_by_them(load, first):
    """A coupler without a parent is that of the four-bar in which it has one."""
    elements = [
        PIN.format("a", "crank", "coupler", "0 0.1 0", "0 0 0"),
        PIN.format("b", "coupler", "rocker", "0.5 0 0", "0 0.3 0"),
    ]
    if first == "coupler":
        elements = [links("coupler"), FOUR_BAR[0].replace('<link name="coupler"/>', ""), *FOUR_BAR[1:], *elements]
    else:
        elements = [*FOUR_BAR, *elements]
    found = load(*elements)
    usual = load(*FOUR_BAR, TURN.format("a", "crank", "coupler", "0 0.1 0"), elements[-1])
    assert (found.mobility, usual.mobility) == (1, 1)
    assert found.nodes[0] == "ground"
    assert set(found.nodes) == {"ground", "crank", "rocker", "coupler"}
    assert found.actuated == ("drive",)
    assert "link 'coupler' has no parent: it moves freely on 'ground', and loops hold it" in found.source.notes
    for q in (found.q_home, *found.random_closed(5)):
        crank, coupler, rocker = (found.placement(q, link).homogeneous for link in ("crank", "coupler", "rocker"))
        np.testing.assert_allclose(crank @ [0.0, 0.1, 0.0, 1.0], coupler @ [0.0, 0.0, 0.0, 1.0], atol=1e-9)
        np.testing.assert_allclose(coupler @ [0.5, 0.0, 0.0, 1.0], rocker @ [0.0, 0.3, 0.0, 1.0], atol=1e-9)
        np.testing.assert_allclose(coupler[2], [0.0, 0.0, 1.0, 0.0], atol=1e-9)  # it stays in the plane


@pytest.mark.parametrize("motors", ["name_mot: [drive]", ""])
def test_files_next_to_a_urdf_join_trees_too(load, tmp_path, motors):
    ends = links("at_crank", "at_rocker", "end")
    fixed = '<joint name="{0}" type="fixed"><parent link="{1}"/><child link="{0}"/><origin xyz="{2}"/></joint>'
    fixed = "".join(fixed.format(*one) for one in (
        ("at_crank", "crank", "0 0.1 0"), ("at_rocker", "rocker", "0 0.3 0"), ("end", "coupler", "0.5 0 0"),
    ))  # fmt: skip
    pairs = "closed_loop: [[at_crank, coupler], [at_rocker, end]]\ntype: [3d, 3d]"
    (tmp_path / "r.yaml").write_text(f"{pairs}\n{motors}\n")
    found = load(*FOUR_BAR, ends, fixed)
    assert found.mobility == 2  # balls: the coupler spins about its own axis
    assert found.actuated == ("drive",)
    assert not [node for node in found.nodes if "_free" in node]
    for q in (found.q_home, *found.random_closed(5)):
        at = {link: found.placement(q, link).translation for link in ("at_crank", "at_rocker", "coupler", "end")}
        np.testing.assert_allclose(at["at_crank"], at["coupler"], atol=1e-9)
        np.testing.assert_allclose(at["at_rocker"], at["end"], atol=1e-9)


def test_two_trees_meet_in_a_link_with_two_parents(load):
    """Both trees are open chains of one arm of three joints: the mobility is that of the arm."""
    meeting = [TURN.format(name, parent, "tool", "0.5 0 0") for name, parent in (("j1", "a1"), ("j2", "b1"))]
    trees = [
        links("a", "a1", "b", "b1", "tool"),
        TURN.format("ja", "a", "a1", "0 0 0"),
        TURN.format("jb", "b", "b1", "0 0 0"),
    ]
    assert load(*trees, *meeting).mobility == 4


def test_trees_that_nothing_joins_are_refused_with_a_joint_that_joins_them(load, tmp_path, capsys):
    elements = [*FOUR_BAR, PIN.format("a", "crank", "rocker", "0 0.1 0", "0.4 0.1 0")]
    with pytest.raises(
        cinegen.CinegenError, match=r"r.urdf:1: 2 links have no parent, .*: 'ground' .*, 'coupler' "
    ) as refused:
        load(*elements)
    joint = re.search("<joint .*</joint>", str(refused.value))[0]
    assert load(*elements, joint).nodes[0] == "ground"
    pinned = [*FOUR_BAR, PIN.format("a", "crank", "coupler", "0 0.1 0", "0 0 0")]
    with pytest.raises(cinegen.CinegenError, match="2 links have no parent"):
        load(*pinned, ignore_loops=True)
    assert load(*pinned, joint, ignore_loops=True).mobility == 2


@pytest.mark.parametrize(("limits", "edit"), [
    ('lower="1" upper="-0.5"', 'lower="-0.5" upper="1"'),
    ('upper="-1"', 'lower="-1" upper="0"'),
    ('lower="0.5"', 'lower="0" upper="0.5"'),
])  # fmt: skip
def test_reversed_limits_are_refused_and_exchanged_on_request(tmp_path, limits, edit, capsys):
    path = tmp_path / "r.urdf"
    path.write_text(robot(links("a", "b"), LIMITED.format(limits)))
    assert main(["info", str(path)]) == 1
    said = capsys.readouterr().err
    assert f"swap them ({edit}), or add --swap-limits (in Python swap_limits=True)" in said
    option = re.search(r"add (--\S+)", said)[1]
    assert main(["info", str(path), option]) == 0
    assert "lower and upper limits exchanged, as requested: j" in capsys.readouterr().err
    assert urdf2raff([str(path), "-o", str(tmp_path / "r.raff"), option]) == 0
    with pytest.warns(UserWarning, match="exchanged"):
        swapped = cinegen.load(path, swap_limits=True)
    path.write_text(robot(links("a", "b"), LIMITED.format(edit)))
    assert swapped.limits["j"][:2] == cinegen.load(path).limits["j"][:2]
