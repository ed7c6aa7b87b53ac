"""Every fault of an MJCF: MuJoCo stops at the first. What its error names is left out, and it is asked again."""

from __future__ import annotations

import re
from typing import Any

from lxml import etree


class FaultyMjcf:
    """An MJCF without includes from which faults are left out, one after another.

    Args:
        root: its first element; changed.
    """

    def __init__(self, root: Any) -> None:
        self._root, self._gone = root, set[str]()
        self._at: dict[int, Any] = {}

    def text(self) -> str:
        """Return the text of what is left, with each element on a line of its own: MuJoCo names lines."""
        for element in self._root.iter("*"):
            element.text, element.tail = "\n" if len(element) else None, "\n"
        text = str(etree.tostring(self._root, encoding="unicode"))
        lines = [element.sourceline for element in etree.fromstring(text).iter("*")]
        self._at = dict(zip(lines, self._root.iter("*"), strict=True))
        return text

    def leave_out(self, why: str) -> tuple[str, int] | None:
        """Leave out what an error of MuJoCo about `text` is about.

        Returns:
            the error with the line in the file, and that line, 0 if it is unknown; an empty text for an error that only
            follows from what was left out before. None if it names nothing that can be left out.
        """
        line = re.search(r"\bline (\d+)", why)
        element = self._at.get(int(line[1])) if line else self._root.find("keyframe")
        words = {*re.findall("'([^']*)'", re.sub("Element (name )?'[^']*'", "", why))}
        follows = bool(self._gone & words) or (bool(self._gone) and line is None)
        if element is None or not self._cut(element, why, words):
            return None
        if follows:
            return "", 0
        return (re.sub(r"\bline \d+", f"line {element.sourceline}", why), element.sourceline) if line else (why, 0)

    def _cut(self, element: Any, why: str, words: set[str]) -> bool:
        """Leave out the attribute that an error quotes, or else what a body has too much, or the element."""
        is_of_value = re.search("keyword|class|repeated", why)
        for key, value in element.attrib.items():
            if key in words or (value in words and is_of_value) or (key == "quat" and "quaternion" in why):
                del element.attrib[key]
                return True
        whole = [element]
        if element.tag == "body":
            tags = ("inertial",) if "inertia" in why else ("joint", "freejoint") if re.search("joint|dofs", why) else ()
            whole = [one for one in element if one.tag in tags]
        for one in whole if element.getparent() is not None and element.tag != "worldbody" else ():
            self._gone |= {str(inner.get("name")) for inner in one.iter("*") if inner.get("name")}
            one.getparent().remove(one)
        return bool(whole)
