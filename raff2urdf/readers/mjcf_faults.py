"""Every fault of an MJCF: MuJoCo stops at the first. What its error names is left out, and it is asked again."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from lxml import etree

from raff2urdf.readers.xml_file import parse_xml
from raff2urdf.shipped import similar_file


class FaultyMjcf:
    """An MJCF with the files that it includes or attaches, from which faults are left out, one after another.

    Args:
        path: of the file.
        roots: first elements of the files, by their paths; changed.

    Attributes:
        root: first element of the file, with the content of the others.
        not_included: what is wrong with an element that includes none of the files, the file of it, and its line.
    """

    def __init__(self, path: Path, roots: Mapping[Path, Any]) -> None:
        self.root, self.not_included, self._gone = roots[path], list[tuple[str, str, int]](), set[str]()
        self._at, self._is_whole, self._misspelled = dict[int, Any](), True, set[Any]()
        self._file = {element: str(file) for file, root in roots.items() for element in root.iter("*")}
        known = {file.absolute(): root for file, root in roots.items()}
        self._paths = {file.absolute(): file for file in roots}
        left = {file: root for file, root in known.items() if root is not self.root}
        while (include := next(self.root.iter("include"), None)) is not None:
            name, within = include.get("file", ""), self._file[include]
            places = [path.absolute().parent / name, Path(within).absolute().parent / name]
            file = next((place for place in places if place.is_file()), None)
            if file in left:
                for element in list(left.pop(file)):
                    include.addprevious(element)
            elif file in known:
                self.not_included.append((f"the file '{name}' is already included", within, include.sourceline))
            else:
                self._is_whole = False
                if file is None:  # what is wrong with one that exists is known
                    self.not_included.append(
                        (f"there is no file '{name}'{similar_file(places[0])}", within, include.sourceline)
                    )
            include.getparent().remove(include)

    def attached(self) -> Iterator[tuple[Any, Path]]:
        """Yield the elements that name a file to be attached, with it; they name its absolute path then."""
        for model in list(self.root.iter("model")):
            for folder in (next(iter(self._paths)).parent, Path(self._file[model]).absolute().parent):
                if (path := folder / model.get("file", "")) in self._paths:
                    model.set("file", str(path))
                    yield model, self._paths[path]
                    break

    def leave_out_model(self, model: Any, name: str | None) -> None:
        """Leave out a file that is attached, and what attaches it."""
        name, self._is_whole = model.get("name", name), False
        for element in [model, *(attach for attach in self.root.iter("attach") if attach.get("model") == name)]:
            element.getparent().remove(element)

    def text(self) -> str:
        """Return the text of what is left, with each element on a line of its own: MuJoCo names lines."""
        for element in self.root.iter("*"):
            element.text, element.tail = "\n" if len(element) else None, "\n"
        text = str(etree.tostring(self.root, encoding="unicode"))
        lines = [element.sourceline for element in parse_xml(text, "").iter("*")]
        self._at = dict(zip(lines, self.root.iter("*"), strict=True))
        return text

    def leave_out(self, why: str) -> tuple[str, str, int] | None:
        """Leave out what an error of MuJoCo about `text` is about.

        Returns:
            the error with the line in its file, that file, and that line, 0 if it is unknown; an empty text for an
            error that only follows from what was left out before. None if it names nothing that can be left out.
        """
        line = re.search(r"\bline (\d+)", why)
        element = self._at.get(int(line[1])) if line else self.root.find("keyframe")
        words = {*re.findall("'([^']*)'", re.sub("Element (name )?'[^']*'", "", why))}
        follows = bool(self._gone & words) or (bool(self._gone) and line is None)
        follows |= not self._is_whole and re.search("unknown|not found|missing", why) is not None
        follows |= element in self._misspelled and "must be positive" in why
        if element is None or not self._cut(element, why, words):
            return None
        file = self._file[element]
        if "unrecognized attribute" in why:
            self._misspelled.add(element)
        if follows or line is None:
            return "" if follows else why, file, 0
        return re.sub(r"\bline \d+", f"line {element.sourceline}", why), file, element.sourceline

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
            whole = [child for child in element if child.tag in tags]
        self._is_whole &= element.tag not in ("model", "attach")
        for removed in whole if element.getparent() is not None and element.tag != "worldbody" else ():
            self._gone |= {str(inner.get("name")) for inner in removed.iter("*") if inner.get("name")}
            removed.getparent().remove(removed)
        return bool(whole)
