"""Mistakes of modelling as beginners make them: the first message names the edit that repairs the robot.

Each row edits the text of a robot that is right, states what the first warning or error says, and makes the edit that
is proposed there. That must give the same robot again: mobility, home, closed loops, and where its nodes are.
"""

import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

import cinegen
from raff2urdf import RaffError

BARS = """RAFF Bars
robot bars {
  base { }
  link 1 { parameters { theta 90 } type 2 pred 0 limits { 10 150 } actuated 1 }
  link 2 { parameters { d 200 theta -90 } type 2 pred 1 limits { -160 0 } }
  link 3 { parameters { d 300 theta 59.0362434679 } type 2 pred 0 limits { 20 170 } }
  frame 4 { parameters { d 420 r 0 } pred 2 }
  frame 5 { parameters { d 233.2380757938 } pred 3 }
  frame 6 { name "tool" parameters { gamma 20 d 250 } pred 2 }
  constraint { frame 4 frame 5 type 2 }
}
"""
"""A crank of 200 mm, upright, a level coupler, a rocker; drawn closed."""

ARM = """RAFF Arm
robot arm {
  base { }
  link 1 { parameters { r 300 } type 2 pred 0 limits { -170 170 } }
  link 2 { parameters { alpha 90 theta 30 } type 2 pred 1 limits { -20 100 } velocity 90
           inertial { mass 2 centre { 125 0 0 } moments { 800 10800 10800 } } }
  link 3 { parameters { d 250 theta -60 } type 2 pred 2 limits { -150 150 } }
  frame 4 { name "tool" parameters { d 200 } pred 3 }
}
"""

CRANK = """RAFF Crank
robot crank {
  base { }
  link 1 { parameters { theta 90 } type 2 pred 0 actuated 1 }
  link 2 { parameters { d 60 theta -126.8698976458 } type 2 pred 1 }
  link 3 { parameters { gamma 90 alpha 90 r 80 } type 1 pred 0 limits { 20 170 } }
  frame 4 { parameters { d 100 } pred 2 }
  frame 5 { parameters { alpha -90 } pred 3 }
  constraint { frame 4 frame 5 type 2 }
}
"""

URDF_ARM = """<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.15 0 0"/><mass value="2"/>
    <inertia ixx="0.001" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"/>
  <link name="tool"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <origin xyz="0 0 0.3" rpy="1.5707963267948966 0 0"/><limit lower="-1.5" upper="2" velocity="3" effort="20"/></joint>
  <joint name="elbow" type="revolute"><origin xyz="0.3 0 0"/>
    <parent link="upper"/>
    <child link="lower"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" velocity="3" effort="10"/></joint>
  <joint name="flange" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="0.25 0 0"/></joint>
</robot>
"""

URDF_BARS = """<robot name="bars">
  <link name="ground"/><link name="crank"/><link name="coupler"/><link name="rocker"/>
  <joint name="drive" type="continuous"><parent link="ground"/><child link="crank"/><axis xyz="0 0 1"/></joint>
  <joint name="elbow" type="continuous"><parent link="crank"/><child link="coupler"/><origin xyz="0 0.2 0"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="swing" type="continuous"><parent link="ground"/><child link="rocker"/><origin xyz="0.3 0 0"/>
    <axis xyz="0 0 1"/></joint>
  <loop_joint name="pin" type="revolute"><link1 link="coupler" xyz="0.42 0 0" rpy="0 0 0"/>
    <link2 link="rocker" xyz="0.12 0.2 0" rpy="0 0 0"/><axis xyz="0 0 1"/></loop_joint>
</robot>
"""

SDF = """<sdf version="1.9"><model name="cart"><link name="base"/>
  <link name="mast"><pose relative_to="base">0 0 0.5 0 0 1.5707963267948966</pose></link>
  <link name="arm"><pose relative_to="mast">0.4 0 0 0 0 0</pose></link>
  <joint name="fix" type="fixed"><parent>world</parent><child>base</child></joint>
  <joint name="turn" type="revolute"><parent>base</parent><child>mast</child>
    <axis><xyz>0 0 1</xyz><limit><lower>-2</lower><upper>2</upper></limit></axis></joint>
  <joint name="tilt" type="universal"><pose relative_to="arm">-0.1 0 0 0 0 0</pose><parent>mast</parent>
    <child>arm</child><axis><xyz>0 1 0</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis>
    <axis2><xyz>1 0 0</xyz></axis2></joint></model></sdf>
"""

MJCF = """<mujoco model="bars"><compiler angle="degree"/>
  <default><default class="bar"><geom type="capsule" size="0.01"/></default></default>
  <worldbody>
    <body name="crank"><joint name="drive" type="hinge" axis="0 0 1" range="-60 120" limited="true"/>
      <geom class="bar" fromto="0 0 0 0 0.2 0"/>
      <body name="coupler" pos="0 0.2 0">
        <joint name="elbow" axis="0 0 1"/>
        <geom class="bar" fromto="0 0 0 0.42 0 0"/></body></body>
    <body name="rocker" pos="0.3 0 0"><joint name="swing" type="hinge" axis="0 0 1"/>
      <geom class="bar" fromto="0 0 0 0.12 0.2 0"/></body></worldbody>
  <equality><connect name="pin" body1="coupler" body2="rocker" anchor="0.42 0 0"/></equality>
  <actuator><motor joint="drive"/></actuator></mujoco>
"""
RIGHT = {
    "BARS": BARS, "ARM": ARM, "CRANK": CRANK, "URDF_ARM": URDF_ARM, "URDF_BARS": URDF_BARS, "SDF": SDF, "MJCF": MJCF,
}  # fmt: skip

Mend = Callable[[str, re.Match[str]], str]


def filled(text: str, said: re.Match[str]) -> str:
    """A text in which <1> is the first group of a message."""
    return re.sub(r"<(\d)>", lambda group: said[int(group[1])], text)


def put(old: str, new: str) -> Mend:
    """The edit: an old text becomes a new one; both may hold groups of the message, by number."""

    def mend(text: str, said: re.Match[str]) -> str:
        before = filled(old, said)
        assert before in text
        return text.replace(before, filled(new, said), 1)

    return mend


def behind(name: str) -> Mend:
    """The edit: the message's first group in the place of the second one, behind a name."""

    def mend(text: str, said: re.Match[str]) -> str:
        head, rest = text.split(name, 1)
        assert said[2] in rest
        return head + name + rest.replace(said[2], said[1], 1)

    return mend


def words(text: str, said: re.Match[str]) -> str:
    """The edit: RAFF's words with their numbers in the place of others, on the line that is named."""
    after, before, line = said[1].split(), said[2].split(), int(said[3]) - 1
    lines = text.split("\n")
    for word, value, old, was in zip(after[::2], after[1::2], before[::2], before[1::2], strict=True):
        written = re.compile(rf"\b{old} {re.escape(was)}(?![\d.])")
        default = re.compile(r"(?= \})")  # what is not written stands before the end of the block
        place = written if written.search(lines[line]) else default
        lines[line] = place.sub(f" {word} {value}" if place is default else f"{word} {value}", lines[line], count=1)
    return "\n".join(lines)


def line(old: str, new: str, number: int = 1) -> Mend:
    """The edit: what matches on the line that a group of the message names becomes a new text."""

    def mend(text: str, said: re.Match[str]) -> str:
        lines, at = text.split("\n"), int(said[number]) - 1
        assert re.search(old, lines[at])
        lines[at] = re.sub(old, filled(new, said), lines[at], count=1)
        return "\n".join(lines)

    return mend


REWRITE = r"write '([^']*)' for '([^']*)' in [^(]*\(line (\d+)\)"
MEANT = r"'(\S+)'[^\n]*: did you mean '(\S+)'\?"


@dataclass(frozen=True)
class Mistake:
    """A mistake: edits of a right text, what the first message says, and the edit that it names."""

    name: str
    right: str
    wrong: tuple[tuple[str, str], ...]
    says: str
    mend: Mend

    @property
    def text(self) -> str:
        """The robot with the mistake."""
        text = RIGHT[self.right]
        for old, new in self.wrong:
            assert old in text
            text = text.replace(old, new, 1)
        return text


def one(name: str, right: str, old: str, new: str, says: str, mend: Mend) -> Mistake:
    return Mistake(name, right, ((old, new),), says, mend)


ROCKER, COUPLER = "d 233.2380757938", "d 420 r 0"
PIN = "{ frame 4 frame 5 type 2 }"
MOVED = ("an axis is offset along itself",)
"""Mistakes whose remedy moves a frame on which nothing else depends."""

MISTAKES = [
    # --- RAFF: loops
    one("an axis is flipped", "BARS", ROCKER, f"{ROCKER} alpha 180", REWRITE, words),
    one("an axis is offset along itself", "BARS", COUPLER, "d 420 r 12", r"frame(5) by \(0, 0, (12)\) mm",
        put(ROCKER, f"{ROCKER} r <2>")),
    one("a digit too many", "BARS", COUPLER, "d 4200 r 0", REWRITE, words),
    one("a wrong parent", "BARS", "type 2 pred 0 limits { 20 170 }", "type 2 pred 2 limits { 20 170 }", REWRITE, words),
    one("a wrong sign of d", "BARS", "d 300", "d -300", REWRITE, words),
    one("a wrong sign of alpha", "CRANK", "gamma 90 alpha 90", "gamma 90 alpha -90", REWRITE, words),
    one("alpha and theta are swapped", "BARS", "d 200 theta -90", "d 200 alpha -90", REWRITE, words),
    one("a loop between wrong frames", "BARS", PIN, "{ frame 6 frame 5 type 2 }", REWRITE, words),
    one("a loop to a link, not to its frame", "BARS", PIN, "{ frame 4 link 3 type 2 }", REWRITE, words),
    one("a rigid loop where a hinge is needed", "BARS", PIN, "{ frame 4 frame 5 type 0 }", REWRITE, words),
    one("a slide where a hinge is needed", "CRANK", "type 2 pred 1", "type 1 pred 1", REWRITE, words),
    one("a loop is named twice", "BARS", f"constraint {PIN}", f"constraint {PIN}\n  constraint {PIN}",
        r":(\d+):\d+: this loop was declared before, first on line \d+: remove one", line(".*", "")),
    one("the frame that closes a loop is missing", "BARS", f"  frame 5 {{ parameters {{ {ROCKER} }} pred 3 }}\n", "",
        r"ends at 5, which does not exist .*: add '(frame 5)'",
        put("  constraint", f"  <1> {{ parameters {{ {ROCKER} }} pred 3 }}\n  constraint")),
    # --- RAFF: numbers and units
    one("units m, and lengths in mm", "ARM", "RAFF Arm\n", "RAFF Arm\nunits m\n", "write '(units mm)' for '(units m)'",
        put("<2>", "<1>")),
    Mistake("all lengths in metres", "BARS", ((ROCKER, "d 0.2332380757938"), ("d 200", "d 0.2"), ("d 300", "d 0.3"),
        (COUPLER, "d 0.42"), ("d 250", "d 0.25")), "did you mean metres[?] Write '(units m)' after the first line",
        put("RAFF Bars\n", "RAFF Bars\n<1>\n")),
    one("an angle in radians", "ARM", "alpha 90", "alpha 1.5708", r"'(alpha 1\.5708)' .* write '(alpha 90)'",
        put("<1>", "<2>")),
    one("limits in radians", "ARM", "{ -20 100 }", "{ -0.349 1.745 }", r"write 'limits (\{ \S+ \S+ \})'",
        put("{ -0.349 1.745 }", "<1>")),
    one("limits are swapped", "ARM", "{ -20 100 }", "{ 100 -20 }",
        r"lower limit (\S+) of link 2 is above its upper limit (\S+): swap them", put("{ <1> <2> }", "{ <2> <1> }")),
    one("moments in kg m2", "ARM", "{ 800 10800 10800 }", "{ 0.0008 0.0108 0.0108 }", r"write 'moments (\{ .* \})'",
        put("{ 0.0008 0.0108 0.0108 }", "<1>")),
    one("a number with a unit", "ARM", "d 250", "d 250mm", r"'(250mm)' is not one: write (\d+)", put("<1>", "<2>")),
    one("a decimal comma", "ARM", "d 250", "d 250,0", r"'(250,0)' is not one: write (\S+)", put("<1>", "<2>")),
    # --- RAFF: words and numbering
    one("a statement is misspelled", "ARM", "link 3 { parameters", "link 3 { paramters", MEANT, put("<1>", "<2>")),
    one("a parameter is misspelled", "ARM", "alpha 90", "alphah 90", MEANT, put("<1>", "<2>")),
    one("the type is a word", "ARM", "type 2 pred 1", "type revolute pred 1",
        r"'(type)' needs a number, and '(revolute)' .*: write '(type 2)'", put("<1> <2>", "<3>")),
    one("the parent is stated twice", "ARM", "type 2 pred 2 limits", "type 2 pred 1 pred 2 limits",
        "'(pred)' is given twice in link 3, first on line 7: remove one", put(" <1> 1 <1> 2", " <1> 2")),
    one("a number is used twice", "ARM", "link 3", "link 2",
        r":(\d+):8: the number 2 is defined twice, .* probably this one to (3)", line("link 2", "link <2>")),
    one("a cycle of parents", "ARM", "type 2 pred 0", "type 2 pred 3", r"such as to '(pred 0)' in link 1",
        put("type 2 pred 3", "type 2 <1>")),
    one("a parent that does not exist", "ARM", "type 2 pred 1", "type 2 pred 7",
        r"the parent of link 2 is (7), which does not exist: did you mean '(1)'", put("pred <1>", "pred <2>")),
    one("a brace too early", "ARM", "theta 30 }", "theta 30 } }", r"link 2 was closed on line (5); remove that '\}'",
        line(r"\} \}", "}")),
    one("a link without parent", "ARM", "type 2 pred 2", "type 2", r":(7):\d+: link 3 has no '(pred)'.*: add it",
        line("type 2", "type 2 <2> 2")),
    one("a coupling to itself", "ARM", "  frame 4", "  coupling { link 3 link 3 ratio 0 }\n  frame 4",
        "a coupling names link 3 twice: name another one", put("  coupling { link 3 link 3 ratio 0 }\n", "")),
    # --- URDF
    one("lower and upper are left out", "URDF_ARM", 'lower="-2" upper="2" ', "",
        r":(\d+): joint 'elbow': no lower and upper limit .*: add (lower) and (upper) to <limit>",
        put('velocity="3" effort="10"', '<2>="-2" <3>="2" velocity="3" effort="10"')),
    one("limits in degrees", "URDF_ARM", 'lower="-2" upper="2"', 'lower="-115" upper="115"',
        r"if these are degrees, write (\S+) and (\S+)", put('lower="-115" upper="115"', 'lower="<1>" upper="<2>"')),
    one("limits of a URDF are swapped", "URDF_ARM", 'lower="-2" upper="2"', 'lower="2" upper="-2"',
        r'swap them \((lower="-2" upper="2")\)', put('lower="2" upper="-2"', "<1>")),
    one("a joint without direction", "URDF_ARM", '<axis xyz="0 0 1"/>\n    <limit lower="-2"',
        '<axis xyz="0 0 0"/>\n    <limit lower="-2"',
        r"the axis '(0 0 0)' of joint 'elbow' must be three numbers, not all 0: (0 0 1), for", put('"<1>"', '"<2>"')),
    one("a type is misspelled", "URDF_ARM", 'elbow" type="revolute"', 'elbow" type="revolut"',
        MEANT.replace("'(", "type '(", 1), put('"<1>"', '"<2>"')),
    one("rpy in degrees", "URDF_ARM", 'rpy="1.5707963267948966 0 0"', 'rpy="90 0 0"',
        r'(rpy="90 0 0") .* write (rpy="[^"]*")', put("<1>", "<2>")),
    one("an origin in mm", "URDF_ARM", 'xyz="0.3 0 0"', 'xyz="300 0 0"', r"elbow is (300) m .*, write (0\.3 0 0) here",
        put("<1> 0 0", "<2>")),
    one("a link with two parents", "URDF_ARM", "</robot>",
        '  <joint name="second" type="fixed"><parent link="base"/><child link="tool"/></joint>\n</robot>',
        r"joint '\w+' closes a loop: its child 'tool' has another parent: if no loop is meant, remove one of the two",
        put('  <joint name="second" type="fixed"><parent link="base"/><child link="tool"/></joint>\n', "")),
    one("a cycle of links", "URDF_ARM", '<parent link="base"/>', '<parent link="tool"/>',
        r"give joint 'shoulder' another parent, such as (<parent link=\"base\"/>)",
        put('<parent link="tool"/>', "<1>")),
    one("a link is misspelled", "URDF_ARM", '<child link="tool"/>', '<child link="tol"/>',
        MEANT.replace("'(", "child '(", 1), put('"<1>"', '"<2>"')),
    one("a link is not declared", "URDF_ARM", '  <link name="tool"/>\n', "",
        r"not a link .*: add (<link name=\"tool\"/>)", put("  <joint", "  <1>\n  <joint")),
    one("a joint mimics itself", "URDF_ARM", '<limit lower="-2"',
        '<mimic joint="elbow" multiplier="0"/>\n    <limit lower="-2"',
        r":(\d+): <mimic> in joint 'elbow' mimics the joint itself: name another joint, or remove it",
        line(r"<mimic.*?/>", "")),
    one("an element is misspelled", "URDF_ARM", '<origin xyz="0.3 0 0"/>', '<orgin xyz="0.3 0 0"/>',
        r"<(orgin)> is not read: did you mean <(origin)>", put("<1>", "<2>")),
    one("an attribute is misspelled", "URDF_ARM", '<origin xyz="0.3 0 0"/>', '<origin xzy="0.3 0 0"/>',
        r"(xzy) of <origin> is not read: did you mean (xyz)", put("<1>", "<2>")),
    one("parent and child are swapped", "URDF_ARM", '<parent link="upper"/>\n    <child link="lower"/>',
        '<parent link="lower"/>\n    <child link="upper"/>',
        "(elbow)' closes a loop: exchange its <(parent)> and <(child)>",
        put('<<2> link="lower"/>\n    <<3> link="upper"/>', '<<2> link="upper"/>\n    <<3> link="lower"/>')),
    one("a name is used twice", "URDF_ARM", 'name="flange"', 'name="elbow"',
        r":(\d+): joint '(elbow)' is defined twice, first on line \d+: change one", line("elbow", "flange")),
    one("moments in kg mm2", "URDF_ARM", 'iyy="0.02" izz="0.02"', 'iyy="20000" izz="20000"',
        r"write a millionth, (\S+) at most", put('iyy="20000" izz="20000"', 'iyy="<1>" izz="<1>"')),
    one("a body without mass", "URDF_ARM", '<mass value="2"/>', '<mass value="0"/>', "but no mass: state its (mass)",
        put('<<1> value="0"/>', '<<1> value="2"/>')),
    one("the other side", "URDF_BARS", '<origin xyz="0.3 0 0"/>', '<origin xyz="-0.3 0 0"/>',
        r'write (xyz="[^"]*") for (xyz="[^"]*") in joint \'swing\'', behind('name="swing"')),
    one("the end of a loop in mm", "URDF_BARS", 'xyz="0.42 0 0"', 'xyz="420 0 0"',
        r'write (xyz="[^"]*") for (xyz="[^"]*") in loop \'pin\' on coupler', behind('link="coupler"')),
    one("a loop to a wrong link", "URDF_BARS", 'link2 link="rocker"', 'link2 link="crank"',
        r"write link '(\w+)' for link '(\w+)' in loop 'pin'", put('link2 link="<2>"', 'link2 link="<1>"')),
    one("a loop to a link that is not there", "URDF_BARS", 'link2 link="rocker"', 'link2 link="roker"',
        MEANT.replace("'(", "names '(", 1), put('"<1>"', '"<2>"')),
    one("the axis of a loop is flipped", "URDF_BARS", 'xyz="0.12 0.2 0" rpy="0 0 0"',
        'xyz="0.12 0.2 0" rpy="3.1416 0 0"', r"the frame of rocker turned by 180 degrees about its (-?)x",
        put('rpy="3.1416 0 0"', 'rpy="0 0 0"')),
    one("a joint about another axis", "URDF_BARS", '<origin xyz="0 0.2 0"/>\n    <axis xyz="0 0 1"/>',
        '<origin xyz="0 0.2 0"/>\n    <axis xyz="0 1 0"/>', r"write (<axis [^>]*>) for (<axis [^>]*>) in joint 'elbow'",
        put("<2>", "<1>")),
    one("a rigid loop of a URDF", "URDF_BARS", 'name="pin" type="revolute"', 'name="pin" type="fixed"',
        r"write (revolute) for rigid in loop 'pin'", put('type="fixed"', 'type="<1>"')),
    # --- SDF
    one("a frame is misspelled", "SDF", 'relative_to="mast"', 'relative_to="mst"', MEANT, put("<1>", "<2>")),
    one("a pose in degrees", "SDF", "0 0 0.5 0 0 1.5707963267948966", "0 0 0.5 0 0 90",
        r"write (<pose degrees=\"true\")>", put('<pose relative_to="base">0 0 0.5', '<1> relative_to="base">0 0 0.5')),
    one("a pose of a position alone", "SDF", "0.4 0 0 0 0 0", "0.4 0 0",
        r"the pose '([^']*)' must be six numbers, [^:]*: '([^']*)'", put("<1>", "<2>")),
    one("a second axis is missing", "SDF", "<axis2><xyz>1 0 0</xyz></axis2>", "",
        r"axis2 of joint 'tilt' is not given: 0 0 1, .* add <(axis2)>",
        put("<child>arm</child>", "<child>arm</child><<1>><xyz>1 0 0</xyz></<1>>")),
    one("an axis is missing", "SDF", "<axis><xyz>0 0 1</xyz><limit><lower>-2</lower><upper>2</upper></limit></axis>",
        "", r"joint 'turn' has 0 of 1 axes: add <(axis)>", put("<child>mast</child>",
        "<child>mast</child><<1>><xyz>0 0 1</xyz><limit><lower>-2</lower><upper>2</upper></limit></<1>>")),
    one("a child is misspelled", "SDF", "<child>arm</child>", "<child>arn</child>", MEANT.replace("'(", "child '(", 1),
        put("<child><1>", "<child><2>")),
    one("a type that SDF does not have", "SDF", 'type="revolute"', 'type="hinge"', MEANT.replace("'(", "type '(", 1),
        put('"<1>"', '"<2>"')),
    one("limits of an SDF are swapped", "SDF", "<lower>-2</lower><upper>2</upper>", "<lower>2</lower><upper>-2</upper>",
        r"lower limit (\S+) of joint 'turn' is above its upper limit (\S+): swap them",
        put("<lower><1></lower><upper><2></upper>", "<lower><2></lower><upper><1></upper>")),
    # --- MJCF
    one("an equality to a body that is not there", "MJCF", 'body2="rocker"', 'body2="roker"', MEANT,
        put('"<1>"', '"<2>"')),
    one("a class is missing", "MJCF", '<default class="bar"><geom type="capsule" size="0.01"/></default>', "",
        r"add (<default class=\"bar\")/> to <default>",
        put("<default>", '<default><1>><geom type="capsule" size="0.01"/></default>')),
    one("a range in radians", "MJCF", 'range="-60 120"', 'range="-1.047 2.094"', r"write (range=\"[^\"]*\"), or angle",
        put('range="-1.047 2.094"', "<1>")),
    one("a range is swapped", "MJCF", 'range="-60 120"', 'range="120 -60"', r"range.*: swap them",
        put('range="120 -60"', 'range="-60 120"')),
    one("a body without joint", "MJCF", '        <joint name="elbow" axis="0 0 1"/>\n', "",
        r"add (<joint axis=\"0 0 1\"/>) to body '(coupler)'",
        put('<body name="<2>" pos="0 0.2 0">', '<body name="<2>" pos="0 0.2 0"><1>')),
    one("a type of URDF", "MJCF", '"elbow" axis', '"elbow" type="revolute" axis', MEANT, put('"<1>"', '"<2>"')),
    one("a joint of MJCF without direction", "MJCF", '"elbow" axis="0 0 1"', '"elbow" axis="0 0 0"',
        r"axis too small in joint .*elbow.*: write its direction, such as (axis=\"0 0 1\")",
        put('axis="0 0 0"', "<1>")),
    one("a weld where a pin is needed", "MJCF",
        '<connect name="pin" body1="coupler" body2="rocker" anchor="0.42 0 0"/>',
        '<weld name="pin" body1="coupler" body2="rocker"/>',
        r"write (revolute) for rigid in loop 'pin' \(--loop pin=revolute\)", put(
        '<weld name="pin" body1="coupler" body2="rocker"/>',
        '<connect name="pin" body1="coupler" body2="rocker" anchor="0.42 0 0"/>')),
]  # fmt: skip


def messages(
    call: Callable[..., object], *arguments: object, errors: Any = (cinegen.CinegenError, RaffError, ValueError)
) -> list[str]:
    """What a call says: warnings, and then the notes of a mechanism, or the error, unless it is raised."""
    with warnings.catch_warnings(record=True, action="always") as caught:
        try:
            result = call(*arguments)
            last = list(result.source.notes) if isinstance(result, cinegen.Mechanism) and result.source else []
        except errors as error:
            last = [str(error)]
    return [*(str(warning.message) for warning in caught), *last]


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake.name.replace(" ", "-"))
def test_the_first_message_names_the_edit_that_repairs_a_mistake(mistake: Mistake) -> None:
    message = messages(cinegen.load, mistake.text)[0]
    said = re.search(mistake.says, message)
    assert said is not None, message
    mended, meant = cinegen.load(mistake.mend(mistake.text, said)), cinegen.load(RIGHT[mistake.right])
    assert (mended.mobility, len(mended.loops), mended.massless) == (meant.mobility, len(meant.loops), meant.massless)
    assert mended.closure(mended.q_home) <= 1e-10
    assert mended.q_home == pytest.approx(meant.q_home, abs=1e-6)
    for node in meant.nodes if mistake.name not in MOVED else ():
        placed, expected = (mechanism.placement(mechanism.q_home, node).homogeneous for mechanism in (mended, meant))
        assert placed == pytest.approx(expected, abs=1e-6)
    for joint in meant.limits if mistake.right != "MJCF" else ():
        assert mended.limits[joint] == pytest.approx(meant.limits[joint], abs=1e-2)


@pytest.mark.parametrize("name", RIGHT)
def test_a_robot_that_is_right_loads_without_a_word(name: str) -> None:
    assert messages(cinegen.load, RIGHT[name]) == []
