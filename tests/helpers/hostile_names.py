"""A robot whose names are code, commands and keys in the languages into which they are written."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

C_CODE = '*/ __attribute__((constructor)) void owned(void) { __builtin_printf("owned\\n"); } /*'
KEYS = ("constructor", "toString", "__proto__", "hasOwnProperty", "valueOf")
"""Names that every object of JavaScript has."""

LINKS = (*KEYS, C_CODE, "</script><script>window.owned = 1</script><!--", "a/b%2F", "=1+1", "$x_{2}$", "..\\..\\x--")
JOINTS = (*LINKS[::-1],)
CONTROLS = "a\x9b2Jb\nchecked: all is well\u202edc\u200b"
"""The name of a robot: control characters that XML allows, and others that change what a terminal shows."""


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
