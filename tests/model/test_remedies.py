"""Every remedy that a message about a robot's file proposes is tried: the file loads, without an error.

A row has a text that is wrong, what the message says, and the edit: an old text and a new one, in which <1> is the
first group of the message. Mistakes whose remedy gives a robot that is known are in test_beginners_mistakes.py.
"""

import json
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import cinegen
import raff2urdf
from raff2urdf import RaffError

Values = dict[str, Any]

ONE = "link 1 { type 2 pred 0 parameters { d 100 } }"
BAR = "frame 2 { pred 1 parameters { d 100 } } link 1 { type 2 pred 0 }"
TWO = f"{ONE} link 2 {{ type 2 pred 1 parameters {{ d 100 }} }}"
SLIDE = f"{ONE} link 2 {{ type 1 pred 1 parameters {{ d 100 }} }}"
COUPLED = 'coupling { name "a" link 2 link 1 ratio 2 }'
BALL = "link 1 { joint ball pred 0 variable x { limits { -9 9 } } }"


def raff(body: str, after: str = "") -> str:
    return f"RAFF t\nrobot r {{ base {{ }}\n{body}\n}}\n{after}"


# text, what the message says, the old text, the new one
OF_RAFF = [
    # words and signs
    (raff('link 1 { type 2 pred 0 name "tool\n }'), "not closed on its line: a '(\")' is missing", '"tool', '"tool<1>'),
    (raff("link 1 { type 2 / hinge\n pred 0 }"), "a lone '/': comments begin with '(//)'", "/ hinge", "<1> hinge"),
    ("robot r { }", "begins with '(RAFF) <name>'", "robot r", "<1> t\nrobot r"),
    ("RAFF\nt\nrobot r { }", "'RAFF <name>', both on (one) line", "RAFF\nt", "RAFF t"),
    (
        raff("link 1 { type 2 pred 0"),
        "ends inside robot r, opened on line 2: a '(})' is missing",
        "pred 0",
        "pred 0 <1>",
    ),
    (raff(ONE) + "}", "one '(})' too many", "}\n}", "<1>\n"),
    (raff("link 1 { type 2 pred 0 name tool }"), "found '(tool)': put it in quotation marks", "name <1>", 'name "<1>"'),
    (raff("frame 1 { pred 0 type 0 }"), "'(type)' does not belong in frame 1, but in '(link) { }'", "frame", "<2>"),
    (
        raff(f'sensor 1 {{ port "/dev/x" }}\n{ONE}'),
        "'(sensor)' is inside robot r: it belongs outside every robot",
        f'sensor 1 {{ port "/dev/x" }}\n{ONE}\n}}',
        f'{ONE}\n}} sensor 1 {{ port "/dev/x" }}',
    ),
    ("RAFF t", "the file has no robot: add '(robot) NAME { }'", "RAFF t", "RAFF t\n<1> r { }"),
    # names
    (
        raff('link 1 { type 2 pred 0 name "world" }'),
        "the name '(world)' is reserved for .*: choose another",
        "<1>",
        "x",
    ),
    (
        raff('link 1 { type 2 pred 0 name "4bar" }'),
        "'(4bar)' can't name a link: .* begins with a letter",
        "<1>",
        "x<1>",
    ),
    (raff(f'{ONE} frame 2 {{ pred 1 name "link1" }}'), "the name '(link1)' is that of link 1: choose", "<1>", "tip"),
    (raff(f'{BALL} frame 2 {{ pred 1 name "link1_X" }}'), "the name '(link1_X)' is needed .*: choose", "<1>", "tip"),
    (
        "RAFF t\nrobot r { }\nrobot r { }",
        "robot '(r)' is defined twice, first on line 2: change",
        "robot r { }\nrobot r",
        "robot r { }\nrobot s",
    ),
    (
        raff(ONE, 'sensor 1 { port "a" } sensor 1 { port "b" }'),
        "sensor (1) is defined twice.*: change",
        'sensor 1 { port "b"',
        'sensor 2 { port "b"',
    ),
    (
        raff("link 1 { joint ball pred 0 variable x { } variable x { } }"),
        "variable (x) of link 1 is defined twice.*: change",
        "variable x { } variable x",
        "variable x { } variable y",
    ),
    # joints
    (raff("link 1 { type 2 pred 0 velocity 0 }"), "the (velocity) limit of link 1 is 0: .*; or left out", "<1> 0", ""),
    (raff("link 1 { type 2 pred 0 effort 0 }"), "the (effort) limit of link 1 is 0: .*, or left out", "<1> 0", ""),
    (raff("link 1 { type 2 pred 0 variable x { } }"), "link 1 has variables .*: remove them", "variable x { }", ""),
    (
        raff("link 1 { type 2 pred 0 variable z { } }"),
        "has variables .*, or write '(joint)' for '(type)'",
        "<2> 2",
        "<1> universal",
    ),
    (raff("link 1 { type 2 joint ball pred 0 }"), "link 1 has both '(type)' and 'joint': remove one", "<1> 2", ""),
    (
        raff("link 1 { joint universal pred 0 limits { -9 9 } }"),
        "write '(limits)' for one of them, in '(variable \\w+) { }'",
        "limits { -9 9 }",
        "<2> { <1> { -9 9 } }",
    ),
    (
        raff("link 1 { joint universal pred 0 variable z { home 9 } }"),
        "the home of .* is '(theta)' of its parameters: write it there",
        "variable z { home 9 }",
        "parameters { <1> 9 }",
    ),
    (
        raff("link 1 { type 0 pred 0 limits { -9 9 } }"),
        "link 1 is fixed, so '(limits)' has no effect: remove it",
        "<1> { -9 9 }",
        "",
    ),
    (raff("link 1 { type 2 pred 0 actuated 0 effort 2 }"), "'(effort)' has no effect: remove it", "<1> 2", ""),
    (
        raff("link 1 { type 2 pred 0 actuated 0 effort 2 }"),
        "'effort' has no effect: .*, or write '(actuated 1)'",
        "actuated 0",
        "<1>",
    ),
    (
        raff("link 1 { type 2 pred 0 parameters { theta 30 } limits { -9 9 } }"),
        "home (30) of link 1 is outside its limits -9 to (9): change",
        "theta <1>",
        "theta <2>",
    ),
    # masses
    (raff("link 1 { type 2 pred 0 inertial { } }"), "the inertial has no '(mass)'", "inertial {", "inertial { <1> 1"),
    (
        raff("link 1 { type 2 pred 0 inertial { mass 1 radius 9 } }"),
        "'(radius)' of link 1 is that of bars .*: add it, or remove 'radius'",
        "<1> 9",
        "",
    ),
    (
        raff(f"{BAR[:-1]} inertial {{ mass 1 radius 9 }} }}"),
        "'radius' of link 1 is that of bars of a '(density)': add it",
        "mass 1",
        "<1> 2700",
    ),
    (
        raff(f"{BAR[:-1]} inertial {{ mass 1 density 9 radius 9 }} }}"),
        "has a 'density', from which '(mass)' follows: remove one",
        "<1> 1",
        "",
    ),
    (
        raff("link 1 { type 2 pred 0 inertial { density 9 } } frame 2 { pred 1 parameters { d 9 } }"),
        "has a 'density' but no graphics: .* or give the '(radius)' of its bars",
        "density 9",
        "density 9 <1> 1",
    ),
    # constraints
    (
        raff(f"{ONE} frame 2 {{ pred 0 parameters {{ d 100 }} }} constraint {{ link 1 link 1 }}"),
        "a loop joins node (1) to itself: name two different nodes",
        "link 1 link 1 }",
        "link 1 frame 2 type 2 }",
    ),
    (
        raff(f"{ONE} constraint {{ link 1 sensor ( 0 4 ) }}"),
        "sensor (4) is not declared",
        "\n}\n",
        '\n}\nsensor <1> { port "/dev/x" }\n',
    ),
    (
        raff(f"{TWO} coupling {{ link 2 }}"),
        "must name the link .*: (link 5 link 3 ratio -2)",
        "link 2 }\n",
        "link 2 link 1 ratio -2 }\n",
    ),
    (
        raff(f"{TWO} coupling {{ link 2 link 1 }}"),
        "link 1 drives a coupling: state its '(ratio)'",
        "link 1 }\n",
        "link 1 <1> 2 }\n",
    ),
    (
        raff(f"{SLIDE} coupling {{ link 2 link 1 ratio 2 }}"),
        "'ratio' couples joints of one type, .*: use '(lead)' \\(a screw\\) or '(radius)'",
        "ratio",
        "<1>",
    ),
    (
        raff(f"{SLIDE} coupling {{ link 2 link 1 ratio 2 }}"),
        "'ratio' couples joints of one type, .*: use '(lead)' \\(a screw\\) or '(radius)'",
        "ratio",
        "<2>",
    ),
    (
        raff(f"{TWO} coupling {{ link 2 link 1 lead 2 }}"),
        "'lead' couples a prismatic and a revolute joint, .*: use '(ratio)'",
        "lead",
        "<1>",
    ),
    (
        raff(f"{BALL} link 2 {{ type 2 pred 1 }} coupling {{ link 2 link 1 ratio 2 }}"),
        "whose (ball) joint .*: write it as successive links, each with a '(type)'",
        "joint <1> pred 0 variable x { limits { -9 9 } }",
        "<2> 2 pred 0",
    ),
    (
        raff(f'{TWO} link 3 {{ type 2 pred 2 }} {COUPLED} coupling {{ name "a" link 3 link 1 ratio 2 }}'),
        "the name '(a)' is that of another coupling: choose",
        '"<1>" link 3',
        '"b" link 3',
    ),
    # sensors
    (raff(ONE, 'sensor 1 { port "/dev/x" axes "x, w" }'), "'(w)' is no axis of a sensor: write (x)", ", <1>", ", y"),
    (raff(ONE, 'sensor 1 { port "/dev/x" axes "x, , y" }'), "an axis is missing here: write (0)", ", ,", ", <1>,"),
    (
        raff(ONE, 'sensor 1 { port "/dev/x" axes "x, y, z, rx, ry, rz, 0" }'),
        "'(0)' is a seventh axis: remove it",
        ", <1>",
        "",
    ),
    (
        raff(ONE, 'sensor 1 { port "/dev/x" axes "999*x" }'),
        r"the factor of '(999\*x)' is too large: write (\S+) at most",
        "<1>",
        "<2>",
    ),
    (raff(ONE, 'sensor 1 { port "/dev/x" axes "x, x" }'), "'x' would command both .*: write (0)", "x, x", "x, <1>"),
]


def urdf(*parts: str) -> str:
    return "\n".join(['<robot name="r">', *(f'<link name="{name}"/>' for name in "abc"), *parts, "</robot>"])


def joint(name: str, parent: str, child: str, inside: str = "", kind: str = "continuous") -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


AB, BC = joint("p", "a", "b"), joint("q", "b", "c")
ENDS = '<link1 link="a"/><link2 link="c"/>'
LOOP = f'<loop_joint name="pin" type="revolute">{ENDS}<axis xyz="1 0 0"/></loop_joint>'


def sdf(inside: str) -> str:
    return f'<sdf version="1.9"><model name="m">{inside}</model></sdf>'


def ball(inside: str) -> str:
    return sdf(f'<link name="a"/><link name="b"/><joint name="p" type="ball"><parent>a</parent>{inside}</joint>')


OF_XML = [
    # URDF: a tree
    (
        urdf(AB, BC).replace('<parent link="a"/>', ""),
        "joint 'p' has no <(parent)>: add it",
        '<child link="b"/>',
        '<<1> link="a"/><child link="b"/>',
    ),
    (
        urdf(AB, BC).replace(' name="q"', ""),
        "this (joint) has no name: give it one",
        "<joint type",
        '<joint name="q" type',
    ),
    ('<robot name="r"></robot>', "the robot 'r' has no (link): add one", "></robot>", '><<1> name="a"/></robot>'),
    (urdf(AB), "join them, as by (<joint .*</joint>)", "</robot>", "<1></robot>"),
    # URDF: couplings
    (
        urdf(AB, joint("q", "b", "c", '<mimic joint="q"/>')),
        "mimics the joint (itself): name another joint, or remove it",
        'joint="q"',
        'joint="p"',
    ),
    (
        urdf(joint("p", "a", "b", '<mimic joint="q"/>'), joint("q", "b", "c", '<mimic joint="p"/>')),
        "mimic each other in a circle: .*: remove one (<mimic)>",
        '<1> joint="p"/>',
        "",
    ),
    (
        urdf(AB, joint("q", "b", "c", '<mimic joint="x"/>')),
        "names joint 'x', which the URDF lacks.*: correct it",
        '"x"',
        '"p"',
    ),
    # URDF: loops
    (
        urdf(AB, BC, LOOP.replace(' type="revolute"', "")),
        'has no type: add (type="revolute")',
        'name="pin"',
        'name="pin" <1>',
    ),
    (
        urdf(AB, BC, LOOP.replace('<link2 link="c"/>', "")),
        "must name two links, by <link1> and <(link2)>",
        "<axis",
        '<<1> link="c"/><axis',
    ),
    (
        urdf(AB, BC, LOOP.replace('link2 link="c"', 'link2 link="a"')),
        "joins '(a)' to itself: name two links",
        'link2 link="<1>"',
        'link2 link="c"',
    ),
    (
        urdf(AB, BC, '<loop name="pin" type="revolute"><predecessor link="a"/></loop>'),
        "has no <(successor)>: add it",
        '<predecessor link="a"/>',
        '<predecessor link="a"/><<1> link="c"/>',
    ),
    # URDF: text
    (
        '<!DOCTYPE robot [<!ENTITY name "a">]>\n<robot name="r"><link name="&name;"/></robot>',
        "the entity 'name' is not read: write its text instead, and remove (<!ENTITY)",
        '[<1> name "a">]>\n<robot name="r"><link name="&name;"',
        '>\n<robot name="r"><link name="a"',
    ),
    # SDF
    (sdf(""), "the model 'm' has no (link): add one", '<model name="m">', '<model name="m"><<1> name="a"/>'),
    (ball(""), "joint 'p' has no <(child)>: add it", "</joint>", "<<1>>b</<1>></joint>"),
    (ball("<child>a</child>"), "joint 'p' joins '(a)' to itself: name two different links", "<child><1>", "<child>b"),
    (
        sdf('<link name="a"><pose relative_to="a">1 0 0 0 0 0</pose></link>'),
        "the pose of '(a)' is given relative to itself: name another frame",
        'relative_to="<1>"',
        'relative_to="__model__"',
    ),
    (
        sdf('<link name="a"/><frame name="f" attached_to="f"/>'),
        "'(f)' is attached to itself: name another frame",
        'attached_to="<1>"',
        'attached_to="a"',
    ),
]


ROWS = OF_RAFF + OF_XML


def problems(robot: str | Path) -> list[str]:
    """The warnings about a text or a file, and its error."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            cinegen.load(robot if isinstance(robot, Path) else f"{robot}\n")
            errors = []
        except (cinegen.CinegenError, RaffError) as error:
            errors = [str(error)]
    return [*(str(warning.message) for warning in caught), *errors]


@pytest.mark.parametrize(("text", "says", "old", "new"), ROWS, ids=[row[1] for row in ROWS])
def test_the_remedy_of_a_message_works(text: str, says: str, old: str, new: str) -> None:
    said = re.search(says, "\n".join(problems(text)))
    assert said is not None, problems(text)
    before, after = (re.sub(r"<(\d)>", lambda group: said[int(group[1])], one) for one in (old, new))
    assert before in text
    assert problems(text.replace(before, after, 1)) == []


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (urdf(AB, BC, '<loop_joint name="pin" type="floating">' + ENDS + "</loop_joint>"), r"(--ignore loop_joint)"),
        (urdf(AB, joint("q", "b", "c", '<mimic joint="x"/>')), r"(--ignore mimic)"),
        (urdf(AB, BC, '<belt name="b"><pulley joint="p"/><pulley joint="q"/></belt>'), r"(--ignore belt)"),
        (urdf(AB, BC, '<belt name="b"><pulley joint="p"/><pulley joint="q"/></belt>'), r"(--ignore-loops)"),
        (urdf(joint("p", "a", "b", '<limit lower="1" upper="-1"/>', "revolute"), BC), r"(--swap-limits)"),
    ],
    ids=lambda value: None,
)  # fmt: skip
def test_an_option_that_a_message_proposes_works(text: str, says: str, tmp_path: Path, capsys) -> None:
    import cinegen.cli

    path = tmp_path / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    said = re.search(says, "\n".join(problems(text)))
    assert said is not None, problems(text)
    assert cinegen.cli.main(["info", str(path), *said[1].split()]) == 0


# --- constraints files --------------------------------------------------------------------------------------------

OF_CONSTRAINTS: list[tuple[Callable[[Values], object], str, Callable[[Values, re.Match[str]], object]]] = [
    (
        lambda file: file["joints"][0].update(limits=[-1, 1]),
        "where limits belong: remove this key",
        lambda file, _: file["joints"][0].pop("limits"),
    ),
    (
        lambda file: file["joints"][0].update(type="prismatic"),
        r"its type is prismatic here and (\w+) in the URDF: correct one",
        lambda file, said: file["joints"][0].update(type=said[1]),
    ),
    (
        lambda file: file["joints"].pop(),
        r"joint '(\w+)' of the URDF is missing: add an entry for it",
        lambda file, said: file["joints"].append({**file["joints"][-1], "name": said[1], "home": 1.5487199537923932}),
    ),
    (
        lambda file: file["joints"].append(file["joints"][0]),
        "is listed twice, also in .*: remove one",
        lambda file, _: file["joints"].pop(),
    ),
    (
        lambda file: file["loops"][0].update(second=file["loops"][0]["first"]),
        "joins '(.*)' to itself: name two different nodes",
        lambda file, _: file["loops"][0].update(second={**file["loops"][0]["first"], "node": "frame5"}),
    ),
    (
        lambda file: file.update(mobility=3),
        r"3 is stated, but the URDF with these loops has (\d): correct the number",
        lambda file, said: file.update(mobility=int(said[1])),
    ),
    (
        lambda file: file.update(urdf_sha256="0" * 64),
        r"if it was meant, put (?:\"urdf_sha256\": )?\"?(\w{64})",
        lambda file, said: file.update(urdf_sha256=said[1]),
    ),
    (
        lambda file: file.pop("urdf_sha256"),
        r"so that a change of either is not noticed: add \"urdf_sha256\": \"(\w{64})\"",
        lambda file, said: file.update(urdf_sha256=said[1]),
    ),
]


@pytest.mark.parametrize(("spoil", "says", "mend"), OF_CONSTRAINTS, ids=[row[1] for row in OF_CONSTRAINTS])
def test_the_remedy_of_a_message_about_a_constraints_file_works(spoil, says, mend, tmp_path: Path) -> None:
    (made,) = raff2urdf.convert("four_bar", tmp_path)
    assert made.constraints is not None
    file = json.loads(made.constraints.read_text(encoding="utf-8"))
    spoil(file)
    made.constraints.write_text(json.dumps(file), encoding="utf-8")
    said = re.search(says, "\n".join(problems(made.file)))
    assert said is not None, problems(made.file)
    mend(file, said)
    made.constraints.write_text(json.dumps(file), encoding="utf-8")
    assert problems(made.file) == []
