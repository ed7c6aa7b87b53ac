"""A robot whose names are code, commands and keys in the languages into which they are written."""

import re
from xml.sax.saxutils import escape, quoteattr

C_CODE = '*/ __attribute__((constructor)) void owned(void) { __builtin_printf("owned\\n"); } /*'
KEYS = ("constructor", "toString", "__proto__", "hasOwnProperty", "valueOf")
"""Names that every object of JavaScript has."""

LINKS = (*KEYS, C_CODE, "</script><script>window.owned = 1</script><!--", "a/b%2F", "=1+1", "$x_{2}$", "..\\..\\x--")
JOINTS = (*LINKS[::-1],)
CONTROLS = "a\x9b2Jb\nchecked: all is well\u202edc\u200b"
"""The name of a robot: control characters that XML allows, and others that change what a terminal shows."""
CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b\u200e\u200f\u2028-\u202e\u2066-\u2069]")
"""None of these reaches a terminal or a file."""


def urdf(robot: str = "arm", links: tuple[str, ...] = LINKS, joints: tuple[str, ...] = JOINTS) -> str:
    """A planar arm of these links and joints, on a link `base`."""
    parts = [f"<robot name={quoteattr(robot, {chr(10): '&#10;'})}>", '<link name="base"/>']
    for parent, link, joint in zip(("base", *links), links, joints, strict=False):
        parts += [
            f"<link name={quoteattr(link)}/>",
            f'<joint name={quoteattr(joint)} type="revolute"><parent link={quoteattr(parent)}/>',
            f'<child link={quoteattr(link)}/><origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>',
            '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>',
        ]
    return "\n".join([*parts, "</robot>"])


NAMES = (
    *LINKS, "a\"b'c", "<b onload=x>", "&amp;", "&#x41;", "]]>", "--><x>", "<!-- x", "<![CDATA[x]]>", "<?xml ?>", "// x",
    "??/", "a\\", "\\n", "/* x", '"); system("x', "'; drop table x; --", "${x}", "`x`", "{{x}}", "%s%n", "%(x)s",
    "{x.__class__}", "# x", "- x", "a: b", "[1,2]", "{a: b}", "!!python/object:x", "null", "NaN", "1e3", "~",
    "@x", "+1", "-1", "end",
    "x,y", "x;y", "a|b", r"$\frac{$", "$", "^_", "\u65e5\u672c\u8a9e", "\U0001f600", "a\u0308", "..", "CON", "~/.x",
    "n" * 200,
)  # fmt: skip
"""Names of links and joints, each of them something else in some language."""
IN_RAFF = tuple(name for name in NAMES if re.fullmatch("[^\\W\\d](\\w|\u0308|[.-])*|\U0001f600", name))
"""Those that RAFF has: its names are XML names."""
UNPRINTABLE = ("\u202ex", "x\u200b", "x\x9b2J")
"""Names that are refused."""


def arm_of(names: tuple[str, ...] = NAMES, robot: str = CONTROLS) -> str:
    """The URDF of a planar arm whose links and joints have these names."""
    return urdf(robot, names, names)


def sdf(names: tuple[str, ...] = NAMES, robot: str = "arm") -> str:
    """The same arm as SDF."""
    parts = [f'<sdf version="1.9"><model name={quoteattr(robot)}><link name="base"/>']
    for parent, name in zip(("base", *names), names, strict=False):
        parts += [
            f"<link name={quoteattr(name)}><pose relative_to={quoteattr(parent)}>0.3 0 0 0 0 0</pose></link>",
            f'<joint name={quoteattr(f"{name} j")} type="revolute"><parent>{escape(parent)}</parent>',
            f"<child>{escape(name)}</child><axis><xyz>0 0 1</xyz></axis></joint>",
        ]
    return "\n".join([*parts, "</model></sdf>"])


def mjcf(names: tuple[str, ...] = NAMES, robot: str = "arm") -> str:
    """The same arm as MJCF."""
    joint = '<joint axis="0 0 1" name={0}/><geom size="0.01" mass="1"/>'
    bodies = "".join(f'<body name={quoteattr(name)} pos="0.3 0 0">{joint.format(quoteattr(name))}' for name in names)
    world = f'<worldbody><body name="base">{bodies}{"</body>" * len(names)}</body></worldbody>'
    return f"<mujoco model={quoteattr(robot)}>{world}</mujoco>"


def raff(names: tuple[str, ...] = IN_RAFF) -> str:
    """The same arm as RAFF."""
    links = [
        f'link {k} {{ name "{name}" parameters {{ d 300 theta 60 }} type 2 pred {k - 1} }}'
        for k, name in enumerate(names, 1)
    ]
    return "\n".join(["RAFF arm", "robot arm {", "base { }", *links, "}"])
