"""Pairs of links that an SRDF disables."""

import json
import pickle
from itertools import combinations, pairwise
from pathlib import Path

import pytest
from lxml import etree
from reference import SHARE

import cinegen
from cinegen.cli import main
from cinegen.collision import clearance_of, load_scene
from cinegen.collision.self_collision import PairReason, disabled_by_srdf, link_pairs

PANDA, PANDA_SRDF = SHARE / "panda_description/urdf/panda.urdf", SHARE / "panda_description/srdf/panda.srdf"

LINKS = "abcde"
CHAIN = (
    '<robot name="chain">'
    + "".join(
        f'<link name="{name}"><collision><geometry><box size="0.1 0.1 0.3"/></geometry></collision></link>'
        for name in LINKS
    )
    + "".join(
        f'<joint name="{one}{other}" type="revolute"><parent link="{one}"/><child link="{other}"/>'
        '<origin xyz="0 0 0.4"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        for one, other in pairwise(LINKS)
    )
    + "</robot>"
)


@pytest.fixture
def chain(tmp_path):
    """`chain(srdf)`: path of a URDF of links a to e, with this SRDF next to it."""
    urdf = tmp_path / "chain.urdf"
    urdf.write_text(CHAIN)

    def write(body: str | None, name: str = "chain.srdf", root: str = "robot") -> Path:
        if body is not None:
            (tmp_path / name).write_text(f'<?xml version="1.0"?>\n<{root} name="chain">\n{body}\n</{root}>')
        return urdf

    return write


def disabled(mechanism) -> set[str]:
    return {"".join(sorted(pair)) for pair in disabled_by_srdf(mechanism)}


def reasons(mechanism) -> dict[str, PairReason]:
    links = mechanism.structure.derived(link_pairs)
    return {links.bodies[i].name + links.bodies[k].name: reason for (i, k), reason in links.reasons.items()}


AC = '<disable_collisions link1="c" link2="a" reason="Never"/>'


def test_a_pair_that_the_srdf_next_to_the_urdf_disables_is_not_checked(chain):
    with_srdf = cinegen.load(chain(AC))
    assert disabled(with_srdf) == {"ac"}
    assert reasons(with_srdf)["ac"] is PairReason.SRDF
    (chain(AC).with_suffix(".srdf")).unlink()
    without = reasons(cinegen.load(chain(None)))
    assert without["ac"] is PairReason.CHECKED
    assert without == reasons(with_srdf) | {"ac": PairReason.CHECKED}


def test_the_srdf_that_is_named_replaces_the_one_next_to_the_urdf(chain, tmp_path):
    chain('<disable_collisions link1="a" link2="d"/>', "other.srdf")
    found = cinegen.load(chain(AC), srdf=tmp_path / "other.srdf")
    assert disabled(found) == {"ad"}
    assert disabled(cinegen.load(chain(AC), ignore=["chain.srdf"])) == set()


def test_a_link_disabled_by_default_is_checked_against_those_enabled_again(chain):
    """As in MoveIt's AllowedCollisionMatrix: disabled pairs are disabled whatever is enabled."""
    found = cinegen.load(
        chain(
            '<disable_default_collisions link="a"/><enable_collisions link1="a" link2="c"/>'
            '<enable_collisions link1="d" link2="a"/><disable_collisions link1="a" link2="d" reason="User"/>'
        )
    )
    assert disabled(found) == {"ab", "ad", "ae"}
    assert reasons(found)["ab"] is PairReason.ADJACENT


def test_the_srdf_stays_with_the_mechanism(chain):
    mechanism = cinegen.load(chain(AC))
    assert disabled(pickle.loads(pickle.dumps(mechanism))) == {"ac"}
    assert disabled(mechanism.structure.with_locked({"ab": 0.0})) == {"ac"}


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (AC.replace('"a"', '"hand"'), r"chain.srdf: 'hand' \(line 3\) is not a link of robot 'chain'"),
        ('<disable_collisions link1="a"/>', "chain.srdf:3: <disable_collisions> has no link2"),
        (AC.replace('"a"', '"c"'), "chain.srdf:3: <disable_collisions> names 'c' twice"),
        ("<disable_collisions", "chain.srdf:.: invalid XML"),
    ],
)
def test_an_srdf_that_is_wrong_is_refused_with_its_place(chain, body, message):
    with pytest.raises(cinegen.CinegenError, match=message):
        cinegen.load(chain(body))


def test_other_files_are_not_taken_for_an_srdf(chain, tmp_path):
    urdf = chain(None)
    chain("", "scene.srdf", root="scene")
    for other, message in ((tmp_path / "scene.srdf", "<scene>"), (urdf, "a URDF"), (tmp_path / "no.srdf", "no.srdf")):
        with pytest.raises(cinegen.CinegenError, match=message):
            cinegen.load(urdf, srdf=other)


def test_moveits_srdf_of_the_panda_is_read_as_its_file_lists_it():
    mechanism = cinegen.load(PANDA, srdf=PANDA_SRDF)
    listed = {
        frozenset((one.get("link1"), one.get("link2"))): one.get("reason")
        for one in etree.parse(PANDA_SRDF).iter("disable_collisions")
    }
    assert disabled_by_srdf(mechanism) == listed
    assert len(listed) == 35
    links = mechanism.structure.derived(link_pairs)
    for (i, k), reason in links.reasons.items():
        pair = frozenset((links.bodies[i].name, links.bodies[k].name))
        assert reason is not PairReason.CHECKED or pair not in listed
        assert reason is not PairReason.SRDF or pair in listed
    assert set(links.reasons.values()) >= {PairReason.SRDF, PairReason.CHECKED}


def test_info_lists_disabled_pairs_with_the_reason(chain, capsys):
    urdf = str(chain(AC + '<disable_collisions link1="b" link2="d"/>'))
    assert main(["info", urdf, "--collision", "--json"]) == 0
    pairs = {
        "".join(one["links"]): one["reason"] for one in json.loads(capsys.readouterr().out)[0]["collision"]["pairs"]
    }
    assert set(pairs) == {"".join(pair) for pair in combinations(LINKS, 2)}
    assert pairs["ac"] == "disabled by chain.srdf: Never"
    assert pairs["bd"] == "disabled by chain.srdf: no reason given"
    assert pairs["ad"] == "checked"
    assert main(["info", urdf, "--collision"]) == 0
    assert "a - c: disabled by chain.srdf: Never" in capsys.readouterr().out


def test_a_scene_names_the_srdf_of_its_robot(chain, tmp_path):
    urdf = chain(None)
    chain(AC, "named.srdf")
    chain('<disable_collisions link1="a" link2="d"/>', "option.srdf")
    scene = tmp_path / "scene.toml"
    scene.write_text(f'robot = {{ file = "{urdf.name}", srdf = "named.srdf" }}\ngoal = {{ point = [0.1, 0, 1] }}\n')
    loaded = load_scene(scene)
    assert disabled(loaded.mechanism) == {"ac"}
    clearance = clearance_of(loaded)
    names = {"".join(sorted(clearance.names(pair))) for pair in range(len(clearance.pairs))}
    assert names == {"ad", "ae", "bd", "be", "ce"}
    assert loaded.document()["robot"] == {"file": "chain.urdf", "srdf": "named.srdf"}
    assert disabled(load_scene(scene, srdf=tmp_path / "option.srdf").mechanism) == {"ad"}
    scene.write_text(scene.read_text().replace("named", "missing"))
    with pytest.raises(cinegen.CinegenError, match=r"robot: srdf .*missing.srdf' does not exist"):
        load_scene(scene)


def test_an_srdf_may_hold_nothing_but_states_of_joints(chain):
    path = chain('<group_state name="bent" group="all"><joint name="ab" value="1"/></group_state>')
    assert disabled(cinegen.load(path)) == set()
    with pytest.raises(cinegen.CinegenError, match="this is a URDF, not an SRDF"):
        cinegen.load(chain('<link name="a"/>'))
