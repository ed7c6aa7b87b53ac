"""Every remedy that a message about a robot's file proposes is tried: the file loads, without an error.

A row has a text that is wrong, what the message says, and an edit for each remedy: an old text and a new one, in which
<1> is the first group of the message. Mistakes whose remedy gives a robot that is known are in
test_beginners_mistakes.py.
"""

import ast
import contextlib
import io
import json
import math
import os
import re
import shutil
import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest import mock

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from proposals import pattern, proposals
from test_actuation import transmissions
from test_beginners_mistakes import BARS, MISTAKES, RIGHT, URDF_BARS, filled, messages
from test_frozen import bars as with_play
from test_frozen import hand
from test_load import closed, planar
from urdf_text import joint_text as joint
from urdf_text import links, robot

import cinegen
import cinegen.cli
import raff2urdf
import raff2urdf.cli
import raff2urdf.urdf2raff.cli
from cinegen.model import ForwardKinematics
from cinegen.model.healing.heal_file import heal_file
from cinegen.model.motion_limits import motion_limits
from cinegen.model.plausible import check_joint, check_lengths, check_revolution, check_speed
from raff2urdf.coupling import Coupling
from raff2urdf.graphics import nff
from raff2urdf.graphics.names import find
from raff2urdf.quantities import ANGLE, LENGTH, parse_range
from raff2urdf.quantities import parse as parse_quantity
from raff2urdf.raff.document import Document
from raff2urdf.readers.options import ReadOptions
from raff2urdf.readers.urdf_file import parse as parse_urdf
from raff2urdf.readers.xacro_file import expanded

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
    (raff("link 1 { type 2 pred 0"), "ends inside robot r, opened on line 2: a '(})' is missing", "pred 0",
     "pred 0 <1>"),
    (raff(ONE) + "}", "one '(})' too many", "}\n}", "<1>\n"),
    (raff("link 1 { type 2 pred 0 name tool }"), "found '(tool)': put it in quotation marks", "name <1>", 'name "<1>"'),
    (raff("frame 1 { pred 0 type 0 }"), "'(type)' does not belong in frame 1, but in '(link) { }'", "frame", "<2>"),
    (raff(f'sensor 1 {{ port "/dev/x" }}\n{ONE}'), "'(sensor)' is inside robot r: it belongs outside every robot",
     f'sensor 1 {{ port "/dev/x" }}\n{ONE}\n}}', f'{ONE}\n}} sensor 1 {{ port "/dev/x" }}'),
    ("RAFF t", "the file has no robot: add '(robot) NAME { }'", "RAFF t", "RAFF t\n<1> r { }"),
    # names
    (raff('link 1 { type 2 pred 0 name "world" }'), "the name '(world)' is reserved for .*: choose another", "<1>",
     "x"),
    (raff('link 1 { type 2 pred 0 name "4bar" }'), "'(4bar)' can't name a link: .* begins with a letter", "<1>",
     "x<1>"),
    (raff(f'{BALL} frame 2 {{ pred 1 name "link1_X" }}'), "the name '(link1_X)' is needed .*: choose", "<1>", "tip"),
    # joints
    (raff("link 1 { type 2 pred 0 velocity 0 }"), "the (velocity) limit of link 1 is 0: .*; or left out", "<1> 0", ""),
    (raff("link 1 { type 2 pred 0 effort 0 }"), "the (effort) limit of link 1 is 0: .*, or left out", "<1> 0", ""),
    (raff("link 1 { type 2 pred 0 variable z { } }"), "has variables .*: remove them, or write '(joint)' for '(type)'",
     "variable z { }", "", "<2> 2", "<1> universal"),
    (raff("link 1 { type 2 joint ball pred 0 }"), "link 1 has both '(type)' and 'joint': remove one", "<1> 2", ""),
    (raff("link 1 { joint universal pred 0 limits { -9 9 } }"),
     "write '(limits)' for one of them, in '(variable \\w+) { }'", "limits { -9 9 }", "<2> { <1> { -9 9 } }"),
    (raff("link 1 { joint universal pred 0 variable z { home 9 } }"),
     "the home of .* is '(theta)' of its parameters: write it there", "variable z { home 9 }", "parameters { <1> 9 }"),
    (raff("link 1 { type 0 pred 0 limits { -9 9 } }"), "link 1 is fixed, so '(limits)' has no effect: remove it",
     "<1> { -9 9 }", ""),
    (raff("link 1 { type 2 pred 0 actuated 0 effort 2 }"), "'effort' has no effect: remove it, or write '(actuated 1)'",
     "effort 2", "", "actuated 0", "<1>"),
    (raff("link 1 { type 2 pred 0 parameters { theta 30 } limits { -9 9 } }"),
     "home (30) of link 1 is outside its limits -9 to (9): change", "theta <1>", "theta <2>"),
    # masses
    (raff("link 1 { type 2 pred 0 inertial { } }"), "the inertial has no '(mass)'", "inertial {", "inertial { <1> 1"),
    (raff(f"{BAR[:-1]} inertial {{ mass 1 radius 9 }} }}"),
     "'radius' of link 1 is that of bars of a '(density)': add it, or remove '(radius)'", "mass 1", "<1> 2700",
     "<2> 9", ""),
    (raff(f"{BAR[:-1]} inertial {{ mass 1 density 9 radius 9 }} }}"),
     "has a 'density', from which '(mass)' follows: remove one", "<1> 1", ""),
    (raff("link 1 { type 2 pred 0 inertial { density 9 } } frame 2 { pred 1 parameters { d 9 } }"),
     "has a 'density' but no graphics: .* or give the '(radius)' of its bars", "density 9", "density 9 <1> 1"),
    # constraints
    (raff(f"{ONE} frame 2 {{ pred 0 parameters {{ d 100 }} }} constraint {{ link 1 link 1 }}"),
     "a loop joins node (1) to itself: name two different nodes", "link 1 link 1 }", "link 1 frame 2 type 2 }"),
    (raff(f"{ONE} constraint {{ link 1 sensor ( 0 4 ) }}"), "sensor (4) is not declared", "\n}\n",
     '\n}\nsensor <1> { port "/dev/x" }\n'),
    (raff(f"{TWO} coupling {{ link 2 }}"), "must name the link .*: (link 5 link 3 ratio -2)", "link 2 }\n",
     "link 2 link 1 ratio -2 }\n"),
    (raff(f"{TWO} coupling {{ link 2 link 1 }}"), "link 1 drives a coupling: state its '(ratio)'", "link 1 }\n",
     "link 1 <1> 2 }\n"),
    (raff(f"{SLIDE} coupling {{ link 2 link 1 ratio 2 }}"),
     "'ratio' couples joints of .*: use '(lead)' \\(a screw\\) or '(radius)'", "ratio", "<1>", "ratio", "<2>"),
    (raff(f"{TWO} coupling {{ link 2 link 1 lead 2 }}"),
     "'lead' couples a prismatic and a revolute joint, .*: use '(ratio)'", "lead", "<1>"),
    (raff(f"{BALL} link 2 {{ type 2 pred 1 }} coupling {{ link 2 link 1 ratio 2 }}"),
     "whose (ball) joint .*: write it as successive links, each with a '(type)'",
     "joint <1> pred 0 variable x { limits { -9 9 } }", "<2> 2 pred 0"),
    (raff(f'{TWO} link 3 {{ type 2 pred 2 }} {COUPLED} coupling {{ name "a" link 3 link 1 ratio 2 }}'),
     "the name '(a)' is that of another coupling: choose", '"<1>" link 3', '"b" link 3'),
    # sensors
    (raff(ONE, 'sensor 1 { port "/dev/x" axes "x, w" }'), "'(w)' is no axis of a sensor: write (x)", ", <1>", ", y"),
    (raff(ONE, 'sensor 1 { port "/dev/x" axes "x, , y" }'), "an axis is missing here: write (0)", ", ,", ", <1>,"),
    (raff(ONE, 'sensor 1 { port "/dev/x" axes "x, y, z, rx, ry, rz, 0" }'), "'(0)' is a seventh axis: remove it",
     ", <1>", ""),
    (raff(ONE, 'sensor 1 { port "/dev/x" axes "999*x" }'),
     r"the factor of '(999\*x)' is too large: write (\S+) at most", "<1>", "<2>"),
    (raff(ONE, 'sensor 1 { port "/dev/x" axes "x, x" }'), "'x' would command both .*: write (0)", "x, x", "x, <1>"),
    (raff("link 1 { type 2\u2003pred 0 }"), r"unexpected character '\\u2003': write a( )space for it", "\u2003", "<1>"),
    (raff("link 1 { type 2 pred 2 } link 2 { type 2 pred 1 }"),
     "is part of a cycle of parents: .*: change the '(pred)' of one of them", "type 2 <1> 2", "type 2 <1> 0"),
    (BARS.replace("constraint",
     'link 7 { type 2 pred 0 } coupling { name "frame4-frame5" link 7 link 1 ratio 2 } constraint'),
     "the name '(frame4-frame5)' is that of a loop: choose another one", 'name "<1>"', 'name "gear"'),
    (raff(f"{TWO} coupling {{ link 2 link 9 ratio 2 }}"),
     "a coupling names link (9), which is not a link that moves: name another one", "link <1>", "link 1"),
    (raff("link 1 { type 2 pred 0 limits { 0 0 } }"),
     "no joint can move: the lower limit of each is its upper limit: correct the (limits)", "<1> { 0 0 }",
     "<1> { 0 9 }"),
    (raff("link 1 { type 2 pred 0 limits { -2.618 2.618 } }"), "angles are in degrees, write '(limits { .* })'",
     "limits { -2.618 2.618 }", "<1>"),
    (raff("link 1 { type 2 pred 0 inertial { density 9 radius 1 } }"),
     "has a 'density', but no children, and so no bars: give its '(mass)'", "density 9 radius 1", "<1> 1"),
    (raff("link 1 { type 2 pred 0 inertial { density 1e11 radius 9e3 } } frame 2 { pred 1 parameters { d 1e6 } }"),
     "has an inertia beyond .*: check the (density) and the units", "<1> 1e11 radius 9e3", "<1> 2700 radius 9"),
    (re.sub(r"theta -?[\d.]+|limits {.*?}", "", BARS).replace("type 2 pred 1", "type 2 pred 1 limits { -2 2 }"),
     r"home is outside those of joint2 .*: change these (limits), or the dimensions", "<1> { -2 2 }",
     "<1> { -180 180 }"),
]  # fmt: skip


def urdf(*parts: str) -> str:
    return robot(links(*"abc"), *parts)


AB, BC = joint("p", "a", "b"), joint("q", "b", "c")
ENDS = '<link1 link="a"/><link2 link="c"/>'
LOOP = f'<loop_joint name="pin" type="revolute">{ENDS}<axis xyz="1 0 0"/></loop_joint>'


def sdf(inside: str) -> str:
    return f'<sdf version="1.9"><model name="m">{inside}</model></sdf>'


def ball(inside: str) -> str:
    return sdf(f'<link name="a"/><link name="b"/><joint name="p" type="ball"><parent>a</parent>{inside}</joint>')


THREE = '<link name="a"/><link name="b"/><link name="c"/>'
GEARBOX = (
    '<joint name="g" type="gearbox"><parent>b</parent><child>c</child><gearbox_ratio>2</gearbox_ratio>'
    "<axis><xyz>0 0 1</xyz></axis><axis2><xyz>0 0 1</xyz></axis2></joint>"
)
OWN = '<raff:robot xmlns:raff="urn:raff2urdf"><raff:coupling name="k" constant="0">{}</raff:coupling></raff:robot>'
TERM = '<raff:term joint="{}" coefficients="1"/>'
TERMS = TERM.format("p") + TERM.format("p") + TERM.format("q")
MIMIC = '<mimic joint="{}" axis="axis"><multiplier>2</multiplier></mimic>'


def hinge(name: str, parent: str, child: str, inside: str) -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent>{parent}</parent><child>{child}</child>'
        f"<axis><xyz>0 0 1</xyz>{inside}</axis></joint>"
    )


OF_XML = [
    # URDF: a tree
    (urdf(AB, BC).replace('<parent link="a"/>', ""), "joint 'p' has no <(parent)>: add it", '<child link="b"/>',
     '<<1> link="a"/><child link="b"/>'),
    (urdf(AB, BC).replace(' name="q"', ""), "this (joint) has no name: give it one", "<joint type",
     '<joint name="q" type'),
    ('<robot name="r"></robot>', "the robot 'r' has no (link): add one", "></robot>", '><<1> name="a"/></robot>'),
    (urdf(AB), "join them, as by (<joint .*</joint>)", "</robot>", "<1></robot>"),
    # URDF: couplings
    (urdf(joint("p", "a", "b", '<mimic joint="q"/>'), joint("q", "b", "c", '<mimic joint="p"/>')),
     "mimic each other in a circle: .*: remove one (<mimic)>", '<1> joint="p"/>', ""),
    # URDF: loops
    (urdf(AB, BC, LOOP.replace(' type="revolute"', "")), 'has no type: add (type="revolute")', 'name="pin"',
     'name="pin" <1>'),
    (urdf(AB, BC, LOOP.replace('<link2 link="c"/>', "")), "must name two links, by <link1> and <(link2)>", "<axis",
     '<<1> link="c"/><axis'),
    (urdf(AB, BC, LOOP.replace('link2 link="c"', 'link2 link="a"')), "joins '(a)' to itself: name two links",
     'link2 link="<1>"', 'link2 link="c"'),
    (urdf(AB, BC, '<loop name="pin" type="revolute"><predecessor link="a"/></loop>'), "has no <(successor)>: add it",
     '<predecessor link="a"/>', '<predecessor link="a"/><<1> link="c"/>'),
    # URDF: text
    ('<!DOCTYPE robot [<!ENTITY name "a">]>\n<robot name="r"><link name="&name;"/></robot>',
     "the entity 'name' is not read: write its text instead, and remove (<!ENTITY)",
     '[<1> name "a">]>\n<robot name="r"><link name="&name;"', '>\n<robot name="r"><link name="a"'),
    # SDF
    (sdf(""), "the model 'm' has no (link): add one", '<model name="m">', '<model name="m"><<1> name="a"/>'),
    (ball(""), "joint 'p' has no <(child)>: add it", "</joint>", "<<1>>b</<1>></joint>"),
    (ball("<child>a</child>"), "joint 'p' joins '(a)' to itself: name two different links", "<child><1>", "<child>b"),
    (sdf('<link name="a"><pose relative_to="a">1 0 0 0 0 0</pose></link>'),
     "the pose of '(a)' is given relative to itself: name another frame", 'relative_to="<1>"',
     'relative_to="__model__"'),
    (sdf('<link name="a"/><frame name="f" attached_to="f"/>'), "'(f)' is attached to itself: name another frame",
     'attached_to="<1>"', 'attached_to="a"'),
    # URDF: couplings of joints
    (urdf(AB, BC, '<coupling name="k"><predecessor link="b"/><ratio value="2"/></coupling>'),
     "declares a coupling, but has no <(successor)>: add it", "<ratio", '<<1> link="c"/><ratio'),
    (urdf(AB, BC, '<coupling name="k"><predecessor link="b"/><successor link="c"/></coupling>'),
     r"has no <ratio>: add (<ratio value=)\"...\"/>", "</coupling>", '<1>"2"/></coupling>'),
    (urdf(AB, BC, '<constraint name="k" type="coupling"></constraint>'), "has no <(term)>: add one for each joint",
     "</constraint>", '<<1> joint="p" coefficients="1"/><<1> joint="q" coefficients="2"/></constraint>'),
    # URDF: a tree
    (urdf(AB, BC).replace('link name="c"', 'link name="c&#9;"'),
     r"the name '(c)\\t' of this link holds a character that can't be printed: change it", "<1>&#9;", "<1>"),
    (urdf(AB, BC, '<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="more.urdf"/>'),
     "'(more.urdf)' by XInclude is not read: write its content into the file",
     '<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="<1>"/>', '<link name="d"/>' + joint("s", "c", "d")),
    (hand((0, 1, None), (-1, 1, 2.0), (0, 1, -1.0)),
     "let no joint move that loops and couplings connect to them: correct these (limits), or the couplings",
     'multiplier="-1.0"/><limit lower="0" upper="1"', 'multiplier="-1.0"/><limit lower="-1" upper="0"',
     'multiplier="-1.0"', 'multiplier="1.0"'),
    # SDF: what links, joints and couplings lack
    (sdf('<link name="world"><inertial/></link>'),
     "a link can't be called '(world)', which is the world itself: rename it", "<1>", "base"),
    (sdf('<link name="a"><inertial><inertia><ixx>1e13</ixx><iyy>1e13</iyy><ixy>9e12</ixy></inertia>'
     "<pose>0 0 0 0 0 0.8</pose></inertial></link>"), "the inertia of link 'a' is beyond .*: check its (units)",
     "<inertia><ixx>1e13</ixx><iyy>1e13</iyy><ixy>9e12</ixy></inertia>", ""),
    (sdf(f"{THREE}{hinge('p', 'a', 'b', '')}{hinge('q', 'b', 'c', MIMIC.format('q'))}"),
     "joint '(q)' mimics itself: name another joint", 'mimic joint="<1>"', 'mimic joint="p"'),
    (sdf(f"{THREE}{hinge('p', 'a', 'b', '')}{hinge('q', 'b', 'c', '')}{GEARBOX}"),
     "has no <(gearbox_reference_body)>: add it", "<gearbox_ratio>", "<<1>>a</<1>><gearbox_ratio>"),
    (sdf(f"{THREE}{hinge('p', 'a', 'b', '')}{hinge('q', 'b', 'c', '')}{OWN.format('')}"),
     "raff:coupling 'k' has no terms: give (raff:term) elements", "</raff:coupling>",
     '<<1> joint="p" coefficients="1"/><<1> joint="q" coefficients="2"/></raff:coupling>'),
    (sdf(f"{THREE}{hinge('p', 'a', 'b', '')}{hinge('q', 'b', 'c', '')}{OWN.format(TERMS)}"),
     "raff:coupling 'k' lists '(p)' twice: join the two terms",
     '<raff:term joint="<1>" coefficients="1"/><raff:term joint="<1>" coefficients="1"/>',
     '<raff:term joint="<1>" coefficients="2"/>'),
]  # fmt: skip


@dataclass(frozen=True, eq=False)
class Case:
    """A mistake: what the message about it says, how it comes about in a folder, and what is left after each remedy."""

    says: str
    message: Callable[[Path], str]
    remedies: Callable[[Path, re.Match[str]], Iterable[list[str]]]


def problems(robot: str | Path, **options: Any) -> list[str]:
    """The warnings about a text or a file, and its error; no notes."""
    return messages(lambda: cinegen.load(robot if isinstance(robot, Path) else f"{robot}\n", **options).name)


def text_case(text: str, says: str, *edits: str) -> Case:
    def remedies(_: Path, said: re.Match[str]) -> Iterator[list[str]]:
        for old, new in zip(edits[::2], edits[1::2], strict=True):
            before = filled(old, said)
            assert before in text
            yield problems(text.replace(before, filled(new, said), 1))

    return Case(says, lambda _: "\n".join(problems(text)), remedies)


# --- constraints files --------------------------------------------------------------------------------------------

OF_CONSTRAINTS: list[tuple[Callable[[Values], object], str, Callable[[Values, re.Match[str]], object]]] = [
    (lambda file: file["joints"][0].update(type="prismatic"),
     r"its type is prismatic here and (\w+) in the URDF: correct one",
     lambda file, said: file["joints"][0].update(type=said[1])),
    (lambda file: file["joints"].pop(1), r"joint '(\w+)' of the URDF is missing: add an entry for it",
     lambda file, said: file["joints"].insert(1, {**file["joints"][1], "name": said[1], "home": -math.pi / 2})),
    (lambda file: file.update(robot="a\ud800"), "holds half a character .*: remove (it)",
     lambda file, _: file.update(robot="a")),
    (lambda file: file["loops"][0].update(name="a\nb"),
     "a character that can't be printed, such as a line break: remove (it)",
     lambda file, _: file["loops"][0].update(name="ab")),
    (lambda file: file["sensor_constraints"][0]["sensors"].append(4),
     r"sensor (\d) is not listed in sensors: add it there",
     lambda file, said: file["sensors"].append({**file["sensors"][0], "number": int(said[1])})),
    (lambda file: file["joints"][0].update(home=1e15),
     r"the home of joint '(\w+)' is 1e\+15, beyond .*: check its unit",
     lambda file, _: file["joints"][0].update(home=math.pi / 2)),
    (lambda file: file["couplings"][0].update(name=file["loops"][0]["name"]),
     r"is also the name of .*: rename (one) of them", lambda file, _: file["couplings"][0].update(name="gear")),
    (lambda file: file["couplings"][0].update(constant=1e15), r"its constant is beyond .*: check its (unit)",
     lambda file, _: file["couplings"][0].update(constant=0.0)),
    (lambda file: file["couplings"][0]["terms"].append(file["couplings"][0]["terms"][0]),
     "lists '.*' twice: (join) the two terms",
     lambda file, _: file["couplings"][0]["terms"].pop().update(coefficients=[2.0])),
    (lambda file: file["loops"][0]["first"]["placement"][0].__setitem__(3, 1e15),
     "a number of its placement is beyond .*: check its (unit)",
     lambda file, _: file["loops"][0]["first"]["placement"][0].__setitem__(3, 0.0)),
    (lambda file: file["joints"].append(file["joints"][0]), "is listed twice, also in .*: remove one",
     lambda file, _: file["joints"].pop()),
    (lambda file: file["loops"][0].update(second=file["loops"][0]["first"]),
     "joins '(.*)' to itself: name two different nodes",
     lambda file, _: file["loops"][0].update(second={**file["loops"][0]["first"], "node": "frame5"})),
    (lambda file: file.update(mobility=3), r"3 is stated, but the URDF with these loops has (\d): correct the number",
     lambda file, said: file.update(mobility=int(said[1]))),
    (lambda file: file.update(urdf_sha256="0" * 64), r"if it was meant, put (?:\"urdf_sha256\": )?\"?(\w{64})",
     lambda file, said: file.update(urdf_sha256=said[1])),
    (lambda file: file.pop("urdf_sha256"),
     r"so that a change of either is not noticed: add \"urdf_sha256\": \"(\w{64})\"",
     lambda file, said: file.update(urdf_sha256=said[1])),
    (lambda file: file.update(version=1), "2 was expected: write the (file) again with raff2urdf",
     lambda file, _: file.update(json.loads(converted(GEARED)["r.constraints.json"]))),
]  # fmt: skip


def constraints_case(
    spoil: Callable[[Values], object], says: str, mend: Callable[[Values, re.Match[str]], object]
) -> Case:
    """Of a URDF whose constraints file is spoilt."""

    def loaded(folder: Path, *changes: Callable[[Values], object]) -> list[str]:
        files = converted(GEARED)
        file = json.loads(files["r.constraints.json"])
        for change in changes:
            change(file)
        return problems(saved(folder, "r.urdf", files["r.urdf"], **{"r.constraints.json": json.dumps(file)}))

    return Case(
        says,
        lambda folder: "\n".join(loaded(folder, spoil)),
        lambda folder, said: [loaded(folder, spoil, lambda file: mend(file, said))],
    )


# --- several files, and options -----------------------------------------------------------------------------------


@dataclass
class Setting:
    """Files, of which the first one is loaded, and options of `load`."""

    folder: Path
    files: dict[str, Any]
    options: Values
    environment: dict[str, str] = field(default_factory=dict)

    def problems(self) -> list[str]:
        """What loading says, with these files in the folder and no others."""
        shutil.rmtree(self.folder)
        for name, content in self.files.items():
            path = self.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
        options = {
            name: raw.format(folder=self.folder) if isinstance(raw, str) else raw for name, raw in self.options.items()
        }
        with mock.patch.dict(os.environ, self.environment):
            said = problems(self.folder / next(iter(self.files)), **options)
        return [message for message in said if "left out, as requested" not in message]


Act = Callable[[Setting, re.Match[str]], object]


def put(old: str, new: str, file: str | None = None) -> Act:
    """Write a new text for an old one, in the first file unless another one is named."""

    def act(it: Setting, said: re.Match[str]) -> None:
        name = file or next(iter(it.files))
        before, text = filled(old, said), it.files[name]
        assert isinstance(text, str)
        assert before in text
        it.files = it.files | {name: text.replace(before, filled(new, said), 1)}

    return act


def change(files: Values | None = None, **options: Any) -> Act:
    """Add or remove (None) files, and give options of `load`."""

    def act(it: Setting, said: re.Match[str]) -> None:
        it.options = it.options | options
        for name, content in (files or {}).items():
            path = it.folder / filled(name, said)
            if content is None:
                it.files = {key: text for key, text in it.files.items() if not (it.folder / key).is_relative_to(path)}
            else:
                it.files = it.files | {path.relative_to(it.folder).as_posix(): filled(content, said)}

    return act


def python(group: int = 1, **words: str) -> Act:
    """Give the option that a group of the message writes in Python, with these words for the placeholders in it."""

    def act(it: Setting, said: re.Match[str]) -> None:
        option, _, value = said[group].partition("=")
        for word, text in words.items():
            value = value.replace(word, repr(text.format(folder=it.folder)))
        it.options = it.options | {option: ast.literal_eval(value)}

    return act


def first(name: str) -> Act:
    """Load another file."""

    def act(it: Setting, said: re.Match[str]) -> None:
        file = filled(name, said)
        it.files = {file: it.files[file], **it.files}

    return act


def environment(it: Setting, said: re.Match[str]) -> None:
    """Set the environment variable that the message's groups name and value."""
    it.environment = {said[1]: said[2] if said.re.groups > 1 else f"{it.folder}/other"}


@cache
def converted(raff_text: str, format: str = "urdf") -> dict[str, str]:
    """The files that raff2urdf makes of a RAFF text."""
    with TemporaryDirectory() as name, warnings.catch_warnings(action="ignore"):
        path = Path(name) / "r.raff"
        path.write_text(raff_text, encoding="utf-8")
        (made,) = raff2urdf.convert(path, name, format=format)
        files = {made.file, *filter(None, [made.constraints])}
        return {file.name: file.read_text(encoding="utf-8") for file in sorted(files, key=lambda f: f != made.file)}


GEAR = "link 7 { type 2 pred 0 parameters { theta 180 } } coupling { link 7 link 1 ratio 2 }"
SENSOR = 'sensor 1 { port "/dev/x" } robot'
GEARED = BARS.replace("constraint {", f"{GEAR} constraint {{ frame 6 sensor ( 0 1 ) }} constraint {{").replace(
    "robot", SENSOR
)
"""A four-bar with a sensor and a gear."""

BARS_FILES = converted(BARS)
CONSTRAINTS = BARS_FILES["r.constraints.json"]
ALONE = {"r.urdf": BARS_FILES["r.urdf"]}
PART = '<link name="b"/>' + joint("p", "a", "b")
XACRO = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{}<link name="a"/></robot>'
MACRO = XACRO.format('<xacro:macro name="arm">' + PART + "</xacro:macro>").replace('<link name="a"/>', "")
FOLLOWS = '<mimic joint="p"/>'
RING = urdf(AB, joint("q", "b", "c", FOLLOWS), joint("s", "a", "c", FOLLOWS))
PINNED = URDF_BARS.replace("loop_joint", "loop_thing")
THING = '<loop_thing name="pin"><link1 link="frame4"/><link2 link="frame5"/></loop_thing></robot>'
UNREAD = re.sub("(?s)<!--.*?-->", "", BARS_FILES["r.urdf"]).replace("</robot>", THING)
YAML = "closed_loop: [[a, c]]\ntype: [6d]\n"
MODEL = '<sdf version="1.9"><model name="part"><link name="x"/></model></sdf>'


def including(inside: str) -> str:
    return sdf(f'<link name="a"/><include><uri>model://part</uri>{inside}</include>')


def srdf(inside: str) -> dict[str, str | bytes]:
    return {"r.urdf": urdf(AB, BC), "r.srdf": f'<robot name="r">{inside}</robot>'}


SPHERE = converted(raff("link 1 { joint ball pred 0 }"))
OWN_ELEMENT = f'<raff:robot xmlns:raff="urn:raff2urdf">{CONSTRAINTS}</raff:robot></robot>'
EMBEDDED = BARS_FILES["r.urdf"].replace("</robot>", OWN_ELEMENT)
CLOSING = [joint(f"f{i}", "b", f"closing_x_{i}", kind="fixed") for i in (1, 2)]
ON_ONE_BODY = urdf(AB, BC, links("closing_x_1", "closing_x_2"), *CLOSING)
PLUGIN = "<plugin name='m'><joint>p</joint><mimicJoint>q</mimicJoint><multiplier>2</multiplier></plugin>"
CONTRADICTED = urdf(AB, joint("q", "b", "c", FOLLOWS), f"<gazebo>{PLUGIN}</gazebo>")
STIFF = '<drake:bushing_{0}_stiffness value="1 0 0"/><drake:bushing_{0}_damping value="1 1 1"/>'
ELASTIC = (
    '<drake:linear_bushing_rpy xmlns:drake="http://drake.mit.edu"><drake:bushing_frameA name="a"/>'
    f'<drake:bushing_frameC name="c"/>{STIFF.format("torque")}{STIFF.format("force")}</drake:linear_bushing_rpy>'
)
BUSHING = urdf(AB, BC, ELASTIC)
SRDF = {"srdf": "{folder}/r.srdf"}

ACCENT = {"r.raff": raff(ONE + " // é")}
UTF_8 = {"r.urdf": '<?xml version="1.0" encoding="utf-8"?><robot name="é"><link name="a"/></robot>'}

# files, options, what the message says, and what it proposes: acts, or several of them for one remedy
OF_FILES: list[tuple[Any, ...]] = [
    # encodings
    ({"r.raff": ACCENT["r.raff"].encode("latin-1")}, {}, "is not UTF-8 text: (save) the file as UTF-8", change(ACCENT)),
    ({"r.urdf": UTF_8["r.urdf"].encode("latin-1")}, {}, "this is not text in utf-8: (save) the file as UTF-8",
     change(UTF_8)),
    ({"r.urdf": UTF_8["r.urdf"].replace("utf-8", "x-own")}, {}, "unknown encoding '(x-own)': save the file as UTF-8",
     change(UTF_8)),
    # MJCF
    ({"r.xml": '<mujoco><asset><model name="m" file="r.xml"/></asset><worldbody><body><joint/><geom size="1"/></body>'
     "</worldbody></mujoco>"}, {}, "r.xml names r.xml, which names it in turn, also through others: (leave one out)",
     put('<model name="m" file="r.xml"/>', "")),
    # xacro
    ({"r.urdf.xacro": XACRO.format('<xacro:include filename="$(find ghost)/arm.xacro"/>'),
     "own/arm.xacro": XACRO.format(PART).replace('<link name="a"/></robot>', "</robot>")}, {},
     r"name its folder by .*\(in Python (packages={'ghost': FOLDER})\)", python(FOLDER="{folder}/own")),
    ({"r.urdf.xacro": XACRO.format('<xacro:include filename="$(find hand)/arm.xacro"/>'), "other/hand/arm.xacro": MACRO,
     "other/hand/package.xml": "<package><name>hand</name></package>"}, {},
     "or add the folder above it to (ROS_PACKAGE_PATH)", environment),
    ({"r.urdf.xacro": XACRO.format(PART.replace('"b"', '"$(arg prefix)b"'))}, {},
     r"the argument 'prefix' has no value: add .*\(in Python (xacro_args={'prefix': VALUE})\)", python(VALUE="l_")),
    ({"r.urdf.xacro": XACRO.format('<xacro:arg name="prefix"/>')}, {},
     'write (<xacro:arg name="prefix" default=""/>), with the default', put('<xacro:arg name="prefix"/>', "<1>")),
    ({"arm.urdf.xacro": MACRO}, {}, "load a (file) that calls them, by (<xacro:include .*/>) (<xacro:arm/>)",
     (change({"own.urdf.xacro": XACRO.format("<2><3>")}), first("own.urdf.xacro"))),
    ({"arm.urdf.xacro": MACRO,
     "own.urdf.xacro": XACRO.format('<xacro:include filename="arm.urdf.xacro"/><xacro:arm/>')}, {},
     r"load \S*/(\S+), which calls them", first("<1>")),
    # MJCF
    ({"part.xml": "<mujocoinclude><body/></mujocoinclude>",
     "r.xml": '<mujoco><worldbody><include file="part.xml"/></worldbody></mujoco>'}, {},
     "this is a (part) of a robot: load the file that includes it", first("r.xml")),
    ({"r.xml": '<mujoco><worldbody><body pos="1e300 0 0"><joint/><geom size="1"/></body></worldbody></mujoco>'}, {},
     "a number of a (body) is beyond .*: check its unit", put("1e300", "1")),
    ({"r.xml": '<mujoco><worldbody><body name="b"><joint/><inertial mass="1e300" pos="0 0 0" '
     'diaginertia="1 1 1"/></body></worldbody></mujoco>'}, {}, "the inertia of body '(b)' is beyond .*: check its unit",
     put("1e300", "1")),
    # included models of SDF
    ({"r.sdf": including("<scale>1</scale>"), "part/model.sdf": MODEL}, {},
     "<(scale)> of the included .* is not read: write the model's content into the file",
     put("<include><uri>model://part</uri><scale>1</scale></include>", '<link name="b"/>')),
    ({"r.sdf": including("<placement_frame>x</placement_frame>"), "part/model.sdf": MODEL}, {},
     "a <placement_frame> is placed by a <(pose)>: add it",
     put("<placement_frame>", "<<1>>0 0 0 0 0 0</<1>><placement_frame>")),
    ({"r.sdf": '<sdf version="1.9"><world name="w"><include merge="true"><uri>model://part</uri></include></world></sdf>',
     "part/model.sdf": MODEL}, {}, "only a model can merge .*: leave out (merge)", put(' <1>="true"', "")),
    ({"r.sdf": including("").replace("model://", "https://here.org/"), "part/model.sdf": MODEL}, {},
     "download it, .*, and name its (folder)", put("https://here.org/", "model://")),
    ({"r.sdf": including(""), "part/model.sdf": '<sdf version="1.9"/>', "other/model.sdf": MODEL}, {},
     "the included 'model://(part)' has no model: name one that has", put("<1>", "other")),
    ({"a/b/r.sdf": including("").replace("model://part", "../../part/model.sdf"), "part/model.sdf": MODEL}, {},
     r"copy the file, or allow its folder by the environment variable (\w+)=(\S+)", environment,
     (change({"a/b/part/model.sdf": MODEL}), put("../../part", "part"))),
    ({"r.sdf": including(""), "part/model.sdf": "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 3\n"},
     {}, r"is a Git LFS pointer: run `git lfs pull` in \S*/(part)", change({"<1>/model.sdf": MODEL})),
    # files next to a URDF
    ({**ALONE, "R.Constraints.json": CONSTRAINTS}, {},
     r"(\S+) differs only in case: rename it to ([\w.]+\w)", change({"<1>": None, "<2>": CONSTRAINTS})),
    ({**ALONE, "loops.json": CONSTRAINTS}, {},
     r"(\S+) fits this URDF and no other one here: rename it to ([\w.]+\w)", change({"<1>": None, "<2>": CONSTRAINTS})),
    ({**ALONE, "own.json": CONSTRAINTS}, {},
     r"(\S+) was written for the same links and joints: copy it to ([\w.]+\w)",
     change({"<2>": CONSTRAINTS})),
    (ALONE, {}, r"Restore .* as ([\w.]+\w), or leave the loops open with .*\(in Python (ignore_loops=True)\)",
     change({"<1>": CONSTRAINTS}), python(2)),
    ({"r.urdf": urdf(AB, BC), "r.constraints.json/x": ""}, {},
     "(r.constraints.json): is not a file: remove it, or leave it out with --ignore r.constraints.json",
     change({"<1>": None}), change(ignore=["r.constraints.json"])),
    ({"r.urdf": urdf(AB, BC), "robot.yml": YAML}, {},
     r"(robot.yml) is not read under this name: rename it to ([\w.]+\w)", change({"<1>": None, "<2>": YAML})),
    # robot.yaml
    ({"r.urdf": urdf(AB, BC), "robot.yaml": YAML.replace("[a, c]", "[a, a]")}, {},
     "the loop joins '(a)' to itself: name two different frames", put("[a, <1>]", "[a, c]", "robot.yaml")),
    ({"r.urdf": urdf(AB, BC), "robot.yaml": YAML.replace("6d", "6d, 3d")}, {},
     "closed_loop has (1) entries, but type has (2): give one for each", put(", 3d", "", "robot.yaml")),
    ({"r.urdf": urdf(AB, BC), "robot.yaml": YAML + "type: [6d]\n"}, {},
     "the key '(type)' is repeated: remove one of them", put("<1>: [6d]\n", "", "robot.yaml")),
    ({"r.urdf": urdf(AB, BC), "robot.yaml": YAML.replace("[[a, c]]", "[[&x c, *x]]")}, {},
     "aliases are not read: write the (value) again", put("&x c, *x", "a, c", "robot.yaml")),
    # SRDF
    (srdf('<disable_collisions link1="a"/>'), SRDF, "has no (link2): name a link of the robot",
     put("/>", ' <1>="b"/>', "r.srdf")),
    (srdf('<disable_collisions link1="a" link2="a"/>'), SRDF, "names '(a)' twice: name two links",
     put('link2="<1>"', 'link2="b"', "r.srdf")),
    (srdf('<disable_collisions link1="a" link2="zzz"/>'), SRDF,
     "'(zzz)' .*: name the SRDF of this robot, or correct the names", put("<1>", "b", "r.srdf")),
    # couplings and loops of a URDF
    ({"r.urdf": RING}, {}, "give it a child of its own, or leave the coupling out with --ignore mimic",
     put(joint("s", "a", "c", FOLLOWS), '<link name="d"/>' + joint("s", "a", "d", FOLLOWS)), change(ignore=["mimic"])),
    ({"r.urdf": urdf(AB, BC, LOOP)}, {"ignore": ["pim"]}, "--ignore pim: .*: did you mean '(pin)'",
     change(ignore=["pin"])),
    ({"r.urdf": PINNED}, {}, r"\(in Python (ignore=\[.*?\])\), or all loops with .*\(in Python (ignore_loops=True)\)",
     python(), python(2)),
    ({"r.urdf": UNREAD}, {}, r"Declare the loops in (\S+) next to the URDF",
     change({"<1>": CONSTRAINTS})),
    ({**BARS_FILES, "r.constraints.json": CONSTRAINTS.replace('"mobility": 1,',
     '"mobility": 1,\n "mobility": 1,')}, {}, "this key is on line .* already: remove (one) of them",
     put('"mobility": 1,\n "mobility": 1,', '"mobility": 1,', "r.constraints.json")),
    ({**SPHERE, "r.constraints.json": SPHERE["r.constraints.json"].replace('[\n    "joint1_X",\n    "joint1_Y"',
     '[\n    "joint1_Y",\n    "joint1_X"')}, {}, "are not successive joints with .*: correct (them), or",
     put('[\n    "joint1_Y",\n    "joint1_X"', '[\n    "joint1_X",\n    "joint1_Y"', "r.constraints.json")),
    ({"r.urdf": EMBEDDED, "r.constraints.json": CONSTRAINTS.replace('"name": "Bars"', '"name": "Bar"')}, {},
     "differs from (r.constraints.json): remove one of them, or write both again with raff2urdf",
     change({"<1>": None}), change(BARS_FILES)),
    ({"r.urdf": ON_ONE_BODY}, {},
     "the frames 'closing_x_1' and '(closing_x_2)' are on one rigid body: put each on another link",
     put('<parent link="b"/><child link="<1>"/>', '<parent link="a"/><child link="<1>"/>')),
    ({"r.urdf": urdf("<!-- raff2urdf constraints: r.constraints.json (0 loops) -->", AB, BC)}, {},
     "Restore that file, or remove the (comment)",
     put("<!-- raff2urdf constraints: r.constraints.json (0 loops) -->", "")),
    ({"r.urdf": CONTRADICTED}, {}, "contradicts .*: correct one of them, or leave it out with --ignore plugin",
     change(ignore=["plugin"]), put("<multiplier>2", "<multiplier>1")),
    ({"r.urdf": BUSHING}, {}, "declare the joint that it stands for, or leave it out with --ignore drake",
     put(ELASTIC, LOOP), change(ignore=["drake:linear_bushing_rpy"])),
    ({"r.urdf": urdf(AB, BC).replace('"c"', '"p_X"'), "robot.yaml": "joint_name: [p]\njoint_type: [SPHERICAL]\n"}, {},
     "can't be written as successive joints: rename '(p_X)', whose name is needed",
     (put('"<1>"', '"c"'), put('"<1>"', '"c"'))),
    # options
    ({"r.urdf": urdf(AB, BC)}, {"packages": {"arm": "/nowhere"}},
     "there is no such folder: name the (folder) of the package", change(packages=None)),
    ({"r.urdf": urdf(AB, BC)}, {"packages": {"arm": "."}}, "has no effect: .*'arm': (leave) it out",
     change(packages=None)),
    ({"r.urdf": urdf(AB, BC)}, {"swap_limits": True},
     "no joint of .* has a lower limit above its upper one: (leave) it out", change(swap_limits=False)),
    ({"r.urdf": urdf(AB, BC)}, {"couplings": [Coupling("c", {"p": (1.0,), "q": (1.0,)})]},
     "a file declares its loops and couplings: give them with a (pinocchio.Model) only", change(couplings=())),
    ({"r.urdf": URDF_BARS}, {"loops": {"pin": "ball"}, "ignore_loops": True},
     "a kind is given for loop 'pin', but all are to be ignored: (leave) one out", change(ignore_loops=False)),
]  # fmt: skip


def files_case(files: dict[str, Any], options: Values, says: str, *remedies: Act | tuple[Act, ...]) -> Case:
    def left(folder: Path, said: re.Match[str]) -> Iterator[list[str]]:
        for acts in remedies:
            it = Setting(folder, files, options)
            for act in acts if isinstance(acts, tuple) else (acts,):
                act(it, said)
            yield it.problems()

    return Case(says, lambda folder: "\n".join(Setting(folder, files, options).problems()), left)


# --- calls and commands -------------------------------------------------------------------------------------------


AHEAD = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))
chain = partial(planar, 0.4, 0.9, 0.7)


def pinned(kind: pin.ContactType = pin.ContactType.CONTACT_3D, **attributes: Any) -> pin.RigidConstraintModel:
    """The end of this chain on its base."""
    made = closed(chain(), kind, 0.7)
    for attribute, value in attributes.items():
        setattr(made, attribute, value)
    return made


def spherical(kind: Any) -> pin.Model:
    model = chain()
    model.addJoint(3, kind(), pin.SE3.Identity(), "j4")
    return model


MIMIC_MODEL = urdf(AB, joint("q", "b", "c", '<mimic joint="p"/>'))
ARM = RIGHT["ARM"]

BENT = BARS.replace("{ d 200", "{ alpha 0.1 d 200")
HEAVY = '<link name="c"><inertial><mass value="${1 + 1}"/></inertial></link>'
UNEXPANDED = urdf(AB, BC).replace('<link name="c"/>', HEAVY)


def unhealed(path: Path) -> object:
    """Heal a file as if no number might change by so much as is needed."""
    with mock.patch("cinegen.model.healing.heal_file.LARGEST_CHANGE", 1e-9):
        return heal_file(path)


def marked(folder: Path, mark: str = "") -> Path:
    """A URDF that can be healed, with a byte-order mark in its constraints file."""
    file = json.loads(CONSTRAINTS)
    tilted = pin.SE3(pin.exp3(np.array([0.001, 0.0, 0.0])), np.zeros(3))
    file["loops"][0]["second"]["placement"] = tilted.homogeneous.tolist()
    return saved(folder, "r.urdf", BARS_FILES["r.urdf"], **{"r.constraints.json": f"{mark}{json.dumps(file)}"})


HINGE = {"closing_pin": "revolute"}


def four_bar(folder: Path, axis: str, *rpy: str) -> Path:
    """A four-bar whose joints are about x, y or z; the frames that close it have these rpy."""

    def at(along: float, up: float) -> str:
        return {"x": f"0 {along} {up}", "y": f"{along} 0 {up}", "z": f"{along} {up} 0"}[axis]

    text = links("ground", "crank", "coupler", "rocker", "closing_pin_1", "closing_pin_2")
    about = f'<axis xyz="{ {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}[axis] }"/>'
    joints = (("ground", "crank", 0, 0), ("crank", "coupler", 0, 0.1), ("ground", "rocker", 0.3, 0))
    for parent, child, *place in joints:
        text += joint(f"to_{child}", parent, child, f'<origin xyz="{at(*place)}"/>{about}')
    ends = (("coupler", "closing_pin_1", 0.35, 0.2), ("rocker", "closing_pin_2", 0.05, 0.3))
    for (parent, child, *place), turned in zip(ends, rpy or ("0 0 0",) * 2, strict=True):
        text += joint(f"to_{child}", parent, child, f'<origin xyz="{at(*place)}" rpy="{turned}"/>', "fixed")
    return saved(folder, "r.urdf", f'<robot name="bars">{text}</robot>')


def refused(call: Callable[[], object]) -> None:
    with pytest.raises(cinegen.ClosureError):
        call()


def linked(folder: Path) -> Path:
    """A URDF beside a link to its constraints file, which is not there."""
    (folder / "r.constraints.json").symlink_to("gone.json")
    return saved(folder, "r.urdf", BARS_FILES["r.urdf"])


def drawing(folder: Path, mesh: str) -> Path:
    """A URDF that is drawn as a mesh; bad ones are cut."""
    content = trimesh.creation.box().export(file_type=mesh[-3:])
    (folder / mesh).write_bytes(content[: len(content) // 2] if mesh.startswith("bad") else content)
    return saved(folder, "r.urdf", DRAWN.format(f'<geometry><mesh filename="{mesh}"/></geometry>'))


DRAWN = urdf(AB, BC).replace('<link name="a"/>', '<link name="a"><visual>{}</visual></link>')
TWO_PASSIVE = raff(
    TWO.replace("pred 1", "actuated 0 pred 1").replace("pred 0", "actuated 1 pred 0")
    + " link 3 { type 2 actuated 0 pred 2 parameters { d 100 } }"
)

DRIVEN = URDF_BARS.replace("</robot>", transmissions("drive", "elbow") + "</robot>")
WEIGHED = raff('link 1 { type 2 pred 0 filename { "gone.stl" } inertial { density 2700 } }')

# what is called with the folder, what the message says, and what is called instead
OF_CALLS: list[tuple[Callable[[Path], object], str, Callable[[Path, re.Match[str]], object]]] = [
    # numbers with units
    (lambda _: parse_range("1...2", LENGTH), r"write LOW(\.\.)HIGH with two dots, such as (\S+) or (\S+)",
     lambda _, said: [parse_range(said[2], LENGTH), parse_range(said[3], LENGTH), parse_range(f"1{said[1]}2", LENGTH)]),
    (lambda _: parse_range("1mm..2", LENGTH), "write the (unit) behind both ends, or behind the second",
     lambda _, said: [parse_range("1mm..2mm", LENGTH), parse_range("1..2mm", LENGTH)]),
    (lambda _: parse_quantity("x", LENGTH), "write a number, with a unit unless it is in (m)",
     lambda _, said: [parse_quantity("1", LENGTH), parse_quantity("1 mm", LENGTH)]),
    # numbers in another unit
    (lambda _: check_lengths(cinegen.load(ARM), "x", [300.0]), "did you mean (300) mm",
     lambda _, said: check_lengths(cinegen.load(ARM), "x", [float(said[1]) / 1e3])),
    (lambda _: check_joint(cinegen.load(ARM), "joint1", [60.0]), r"did you mean 60 degrees, which are (\S+) rad",
     lambda _, said: check_joint(cinegen.load(ARM), "joint1", [float(said[1])])),
    (lambda _: check_speed(cinegen.load(ARM), "joint2", 60.0), r"did you mean 60 degrees/s, which are (\S+) rad/s",
     lambda _, said: check_speed(cinegen.load(ARM), "joint2", float(said[1]))),
    (lambda _: check_revolution("rz", -60.0, 60.0), r"did you mean (-60\.\.60deg)",
     lambda _, said: check_revolution("rz", *parse_range(said[1], ANGLE))),
    (lambda _: motion_limits(cinegen.load(ARM), acceleration=-1.0), "give a finite number above (0)",
     lambda _, said: motion_limits(cinegen.load(ARM), acceleration=1.0)),
    # models of Pinocchio
    (lambda _: cinegen.load(chain(), robot="r"), "robot has no effect on a pinocchio.Model: leave it (out)",
     lambda _, said: cinegen.load(chain())),
    (lambda _: cinegen.load(chain(), loops=[pinned(name="pin"), pinned(name="pin")]),
     "loop name '.*' is used twice: give each its (own)",
     lambda _, said: cinegen.load(chain(), loops=[pinned(name="pin"), pinned(name=said[1])])),
    (lambda _: cinegen.load(spherical(pin.JointModelPlanar)),
     "is of the kind Planar, which no URDF has: build it of (revolute) and prismatic joints",
     lambda _, said: cinegen.load(chain())),
    (lambda _: cinegen.load(chain(), loops=["pin"]),
     "give pinocchio.(RigidConstraintModel) of the type CONTACT_6D or (CONTACT_3D)",
     lambda _, said: cinegen.load(chain(), loops=[pinned(getattr(pin.ContactType, said[2]))])),
    (lambda _: cinegen.load(chain(), loops=[pinned(desired_contact_placement=AHEAD)]),
     "its ends meet: move (desired_contact_placement) into one of them",
     lambda _, said: cinegen.load(chain(), loops=[pinned()])),
    (lambda _: replace(cinegen.load(MIMIC_MODEL), model=pin.buildModelFromXML(MIMIC_MODEL, mimic=True)),
     r"build the model with it as an independent joint \((mimic=False) in Pinocchio\)",
     lambda _, said: replace(cinegen.load(MIMIC_MODEL), model=pin.buildModelFromXML(MIMIC_MODEL, **literal(said[1])))),
    # configurations
    *((lambda _, made=made: set_q(made(cinegen.load(BARS)), False), r"use mechanism\.(close)\(q\)",
     lambda _, said, made=made: set_q(made(cinegen.load(BARS)), True))
     for made in (ForwardKinematics, lambda mechanism: cinegen.Solver(mechanism, 0.01))),
    # loops, and their ends
    *((lambda folder, axis=axis: cinegen.load(four_bar(folder, axis), loops=HINGE),
     f'takes 1 DoF .* that it leaves about their {axis} axes(?s:.*)turn both frames by rpy="(.*)", or leave',
     lambda folder, said, axis=axis: cinegen.load(four_bar(folder, axis, said[1], said[1]), loops=HINGE))
     for axis in "xy"),
    (lambda folder: cinegen.load(four_bar(folder, "z")),
     r"--loop (\w+)=(revolute) for a hinge about their z axes",
     lambda folder, said: cinegen.load(four_bar(folder, "z"), loops={said[1]: said[2]}).loops),
    (lambda _: cinegen.load(with_play(0.45)),
     r"--exact \(in Python load\((relax=False)\), convert\(exact=True\)\) refuses such gaps",
     lambda _, said: refused(lambda: cinegen.load(with_play(0.45), **literal(said[1])))),
    (lambda folder: cinegen.load(linked(folder)), r"is a link to (gone.json), which does not exist: restore that file",
     lambda folder, said: cinegen.load(saved(folder, "r.urdf", BARS_FILES["r.urdf"],
     **{said[1]: CONSTRAINTS}))),
    (lambda folder: unhealed(saved(folder, "bent.raff", BENT)),
     r"check their geometry, or load the robot with weaker joints there \(--relax, or --loop NAME=(ball), of the other",
     lambda folder, said: cinegen.load(folder / "bent.raff", relax=True),
     lambda folder, said: cinegen.load(folder / "bent.raff", loops={"frame4-frame5": said[1]})),
    (lambda folder: heal_file(marked(folder, "\ufeff")),
     "is not UTF-8 text without a byte-order mark: (save) it as UTF-8", lambda folder, said: heal_file(marked(folder))),
    # meshes
    (lambda folder: cinegen.load(drawing(folder, "bad.stl")).visual, "the mesh .* can't be read: .*: (export) it again",
     lambda folder, said: cinegen.load(drawing(folder, "good.stl")).visual),
    # the tree of a URDF by itself, as raff2urdf writes it
    (lambda _: parse_urdf(urdf(AB, BC, joint("s", "a", "c")), "r"),
     r"Give the joint a child of its own .*, or leave this joint out with .*\(in Python (ignore_loops=True)\)",
     lambda _, said: parse_urdf(urdf(AB, BC, '<link name="d"/>' + joint("s", "a", "d")), "r"),
     lambda _, said: cinegen.load(urdf(AB, BC, joint("s", "a", "c")), **literal(said[1]))),
    (lambda _: parse_urdf(urdf(AB, BC, joint("s", "c", "a")), "r"),
     "every link has a parent: remove the (joint) above the link that is the root",
     lambda _, said: parse_urdf(urdf(AB, BC), "r")),
    (lambda folder: cinegen.load(saved(folder, "r.urdf", UNEXPANDED)),
     r"It contains xacro .*: load the output of `xacro (\S+)`",
     lambda folder, said: cinegen.load(expanded(Path(said[1]), ReadOptions()).text)),
    (lambda _: expanded(Path("-"), ReadOptions()),
     "xacro can't be read from standard input: pipe the output of `xacro`, or name the (file)",
     lambda folder, said: expanded(saved(folder, "r.urdf.xacro", XACRO.format("")), ReadOptions())),
    # texts
    (lambda _: cinegen.load(MACRO), "xacro is a program: load its file, (.urdf.xacro)",
     lambda folder, said: cinegen.load(saved(folder, f"r{said[1]}", MACRO.replace("</robot>",
     '<link name="a"/><xacro:arm/></robot>')))),
    (lambda _: cinegen.load(PINNED), r"Load the URDF from a file with such a file, NAME(.constraints.json), next to it",
     lambda folder, said: cinegen.load(saved(folder, "r.urdf", UNREAD,
     **{f"r{said[1]}": CONSTRAINTS}))),
    (lambda _: cinegen.load(TWO_PASSIVE),
     r"let joint2, joint3 be actuated too; load\(\.\.\., (actuated)=\[\.\.\.\]\) declares that",
     lambda _, said: cinegen.load(TWO_PASSIVE, **{said[1]: ["joint1", "joint2", "joint3"]})),
    (lambda folder: cinegen.load(saved(folder, "r.raff", TWO_PASSIVE)),
     "let (joint2, joint3) be actuated too; '(actuated 1)' in its link declares that",
     lambda folder, said: cinegen.load(saved(folder, "r.raff", TWO_PASSIVE.replace("actuated 0", said[2])))),
    (lambda _: cinegen.load(DRIVEN), r"elbow is passive; .*\(in Python (actuated)=\[\.\.\.\]\) names others",
     lambda _, said: cinegen.load(DRIVEN, **{said[1]: ["drive"]})),
    (lambda _: cinegen.load(WEIGHED), "its graphics 'gone.stl' can't be read: .* Give its '(mass)'",
     lambda _, said: cinegen.load(WEIGHED.replace("density 2700", f"{said[1]} 1"))),
    (lambda _: nff.loads("nff\na\n3\n0 0 0 0xgg\n1 0 0\n0 1 0\n1\n3 0 1 2 0xf00\n"),
     "is not a colour: write (0x)RGB or 0xRRGGBB",
     lambda _, said: nff.loads(f"nff\na\n3\n0 0 0 {said[1]}f00\n1 0 0\n0 1 0\n1\n3 0 1 2 0xf00\n")),
    (lambda _: raff2urdf.dumps(Document('a"b')), "no notation for a (quotation mark) or a line's end: remove it",
     lambda _, said: raff2urdf.dumps(Document("ab"))),
    (lambda folder: find("http://here/part.stl", folder), "'http://' can't be read: name a (file)",
     lambda folder, said: find("part.stl", saved(folder, "part.stl", "solid").parent)),
]  # fmt: skip


def literal(text: str) -> Values:
    """An argument as a message writes it: NAME=VALUE."""
    name, _, value = text.partition("=")
    return {name: ast.literal_eval(value)}


def saved(folder: Path, name: str, content: str, **others: str) -> Path:
    for file, text in {name: content, **others}.items():
        (folder / file).write_text(text, encoding="utf-8")
    return folder / name


def set_q(moved: ForwardKinematics | cinegen.Solver, is_closed: bool) -> None:
    q = moved.mechanism.q_home + np.array([0.3, 0.0, 0.0])
    moved.q = moved.mechanism.close(q) if is_closed else q


def call_case(wrong: Callable[[Path], object], says: str, *rights: Callable[[Path, re.Match[str]], object]) -> Case:
    def remedies(folder: Path, said: re.Match[str]) -> Iterator[list[str]]:
        for right in rights:
            yield [message for message in messages(right, folder, said, errors=()) if said[0] in message]

    return Case(says, lambda folder: "\n".join(messages(wrong, folder)), remedies)


RAFF2URDF, URDF2RAFF, CINEGEN = raff2urdf.cli.main, raff2urdf.urdf2raff.cli.main, cinegen.cli.main
TWO_ROBOTS = raff(ONE) + "robot s { }\n"

# the program, its files, its arguments, what it says, and the arguments for each remedy; <1> is the first group
OF_COMMANDS: list[tuple[Any, ...]] = [
    (RAFF2URDF, {"r.raff": TWO_ROBOTS}, "r.raff -o s.urdf",
     r"holds several robots \(r, (s)\): name one with (--robot), or a (folder) to write to",
     "r.raff <2> <1> -o s.urdf", "r.raff -o <3>/"),
    (RAFF2URDF, {"r.raff": raff(ONE), "r.urdf": "mine"}, "r.raff -o r.urdf",
     "exists already: name another (file), or replace it with (--force)", "r.raff -o <1>.urdf", "r.raff -o r.urdf <2>"),
    (RAFF2URDF, {"r.raff": raff(ONE), "r.urdf": converted(raff(ONE))["r.urdf"].replace("0.1", "0.2")},
     "r.raff -o r.urdf", "was changed by hand .*: name another (file), or replace it with (--force)",
     "r.raff -o <1>.urdf", "r.raff -o r.urdf <2>"),
    (CINEGEN, {"r.urdf": urdf(AB, BC)}, "info r.urdf --package arm", "write (NAME=VALUE), for example", "info r.urdf"),
    (CINEGEN, {"r.urdf": urdf(AB, BC)}, "info r.urdf --loop arm", "write (NAME=KIND), for example", "info r.urdf"),
    (CINEGEN, {"r.urdf.xacro": XACRO.format('<xacro:arg name="prefix" default=""/>')},
     "info r.urdf.xacro --xacro-arg prefix=a --xacro-arg prefix=b", "'prefix' is given twice: (leave) one out",
     "info r.urdf.xacro --xacro-arg prefix=a"),
    (CINEGEN, {"r.urdf": urdf(AB, BC, '<loop_joint name="pin" type="floating">' + ENDS + "</loop_joint>")},
     "info r.urdf", "(--ignore loop_joint)", "info r.urdf <1>"),
    (CINEGEN, {"r.urdf": urdf(AB, joint("q", "b", "c", '<mimic joint="x"/>'))}, "info r.urdf", "(--ignore mimic)",
     "info r.urdf <1>"),
    (CINEGEN, {"r.urdf": urdf(joint("p", "a", "b", '<limit lower="1" upper="-1"/>', "revolute"), BC)}, "info r.urdf",
     "(--swap-limits)", "info r.urdf <1>"),
    (URDF2RAFF, {"r.urdf": DRAWN.format('<geometry><box size="1 1 1"/></geometry>')}, "r.urdf -o -",
     "name a regular (file), or give (--no-graphics)", "r.urdf -o <1>.raff", "r.urdf -o - <2>"),
    (URDF2RAFF, {"r.urdf": DRAWN.format(""), "s.urdf": DRAWN.format('<geometry><box size="1 1 1"/></geometry>')},
     "r.urdf -o r.raff", "this visual has no shape: add a <(box)>", "s.urdf -o r.raff"),
    (URDF2RAFF, {"r.urdf": DRAWN.format("<geometry><cone/></geometry>"),
     "s.urdf": DRAWN.format('<geometry><sphere radius="1"/></geometry>')}, "r.urdf -o r.raff",
     "the shape <cone> is not in URDF: use <box>, <cylinder>, <(sphere)>", "s.urdf -o r.raff"),
]  # fmt: skip


def run(program: Callable[[list[str]], int], folder: Path, files: dict[str, str], arguments: str) -> tuple[int, str]:
    """The status of a command, and what it says; it runs in a folder with these files."""
    for name, content in files.items():
        (folder / name).write_text(content, encoding="utf-8")
    streams = io.StringIO()
    with (
        contextlib.chdir(folder),
        warnings.catch_warnings(action="always"),
        contextlib.redirect_stdout(streams),
        contextlib.redirect_stderr(streams),
    ):
        status = program(arguments.split())
    return status, streams.getvalue()


def command_case(
    program: Callable[[list[str]], int], files: dict[str, str], wrong: str, says: str, *rights: str
) -> Case:
    def remedies(folder: Path, said: re.Match[str]) -> Iterator[list[str]]:
        for right in rights:
            status, message = run(program, folder, files, filled(right, said))
            yield [message] if status or said[0] in message else []

    return Case(says, lambda folder: " ".join(run(program, folder, files, wrong)[1].split()), remedies)


# --- all of them --------------------------------------------------------------------------------------------------

CASES = [
    *(text_case(*row) for row in OF_RAFF + OF_XML), *(constraints_case(*row) for row in OF_CONSTRAINTS),
    *(files_case(*row) for row in OF_FILES), *(call_case(*row) for row in OF_CALLS),
    *(command_case(*row) for row in OF_COMMANDS),
]  # fmt: skip


@pytest.fixture(scope="module")
def met(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Case], tuple[Path, str]]:
    """`met(case)`: its folder, and what is said there; it comes about once."""

    @cache
    def made(case: Case) -> tuple[Path, str]:
        folder = tmp_path_factory.mktemp("case")
        return folder, case.message(folder)

    return made


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.says)
def test_the_remedies_of_a_message_work(case: Case, met: Callable[[Case], tuple[Path, str]]) -> None:
    folder, message = met(case)
    said = re.search(case.says, message)
    assert said is not None, message
    for left in case.remedies(folder, said):
        assert left == []


# --- completeness -------------------------------------------------------------------------------------------------

LOADING = ("raff2urdf", "cinegen/model")
"""Folders whose messages are about files, loading, converting and healing."""

ELSEWHERE = {
    "python3 -m pip": "installs a package, from the network",
    "convert it with Gazebo's `gz sdf --convert`": "a program of others, which is not installed",
    "joint values count from there: add home of raff:joint": "no message: a comment in an SDF for its readers",
    "would lack the loops": "tests/cli/test_heal_command.py",
}
"""Words of messages whose remedy is not in a table here, and why, or which test tries it."""


def test_every_remedy_that_a_message_about_files_proposes_is_tried(met, root: Path) -> None:
    """What a row reads in a message comes from templates in the sources; each that proposes something is met."""
    read = [(met(case)[1], case.says) for case in CASES]
    read += [(messages(cinegen.load, mistake.text)[0], mistake.says) for mistake in MISTAKES]
    spans = [(message, said) for message, says in read if (said := re.search(says, message))]
    untried = {}
    for path in sorted(path for folder in LOADING for path in (root / folder).rglob("*.py")):
        if path.name in ("cli.py", "command_line.py"):
            continue
        for line, template in proposals(path):
            if not any(meet(hit, said) for message, said in spans for hit in pattern(template).finditer(message)):
                untried[template] = f"{path.relative_to(root)}:{line}"
    excused = {template for template in untried if any(words in template for words in ELSEWHERE)}
    assert {template: at for template, at in untried.items() if template not in excused} == {}
    assert all(any(words in template for template in excused) for words in ELSEWHERE)


def meet(part: re.Match[str], other: re.Match[str]) -> bool:
    """Whether two parts of one text have a character in common."""
    return part.start() < other.end() and other.start() < part.end()
