"""A loop or a coupling that a file declares, in whatever dialect, and which of them a user asks to ignore."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from raff2urdf.errors import RaffError, did_you_mean, first_of
from raff2urdf.escape import shell_word
from raff2urdf.readers.loops.loop_joint import LoopJoint
from raff2urdf.readers.urdf_tree import UrdfTree

CouplingEntry = dict[str, Any]
"""An entry of `couplings` in a constraints file."""


@dataclass(frozen=True, slots=True)
class Declaration:
    """A loop or a coupling that a file declares.

    Attributes:
        line: of the file.
        dialect: the kind of element, or the file.
        label: the element, in a few words.
        text: the element and what it declares.
        name: of the loop or coupling; empty if it has none.
        coupling: whether it couples joints.
        certain: whether it certainly removes degrees of freedom.
        read: returns what it declares; None if it can't be read.
        element: of the file; None for a loop of another file.
        notes: about what is read, for `cinegen info`.
        also: more words by which it can be ignored.
    """

    line: int
    dialect: str
    label: str
    text: str
    name: str = ""
    coupling: bool = False
    certain: bool = True
    read: Callable[[UrdfTree], LoopJoint | CouplingEntry] | None = None
    element: Any = None
    notes: tuple[str, ...] = ()
    also: tuple[str, ...] = field(default=())

    @property
    def words(self) -> tuple[str, ...]:
        """Words by which it can be ignored: its dialect, its name, its element."""
        tag = [] if self.element is None else [tag_of(self.element), local(self.element)]
        return tuple(word for word in (*tag, self.dialect, self.name, *self.also) if word)


def declared(
    element: Any, dialect: str, reader: Callable[[UrdfTree, Any], LoopJoint | CouplingEntry], label: str = "",
    name: str | None = None, coupling: bool = False, text: str = "", **settings: Any,
) -> Declaration:  # fmt: skip
    """Return what an element declares.

    Args:
        element: of the file.
        dialect: its kind.
        reader: returns what it declares.
        label: the element, in a few words; its tag and name unless given.
        name: of the loop or coupling; that of the element unless given.
        coupling: whether it couples joints.
        text: the element and what it declares; the label unless given.
        settings: others of `Declaration`.
    """
    label = label or label_of(element)
    text = text or f"{label} declares a {'coupling' if coupling else 'loop'}"
    return Declaration(
        element.sourceline, dialect, label, text, element.get("name", "") if name is None else name, coupling=coupling,
        read=lambda tree: reader(tree, element), element=element, **settings,
    )  # fmt: skip


class IgnoreList:
    """Elements to be ignored, by their tag or name (`--ignore`).

    Attributes:
        given: their tags or names.
    """

    def __init__(self, words: Iterable[str] = ()) -> None:
        self.words = tuple(word.strip("<>") for word in words)
        self._used: set[str] = set()
        self._known: dict[str, None] = {}

    def takes(self, *words: str) -> bool:
        """Return whether an element that has these words is to be ignored."""
        self._known.update(dict.fromkeys(words))
        taken = {word for word in self.words if word in words}
        self._used |= taken
        return bool(taken)

    def check(self, name: str) -> None:
        """Check that every word was used.

        Args:
            name: of the file, in the error.

        Raises:
            RaffError: a word names no element that could be ignored.
        """
        for word in self.words:
            if word not in self._used:
                known = list(self._known)
                near = did_you_mean(word, known) or (f": it has {', '.join(known[:12])}" if known else "")
                raise RaffError(f"{name}: --ignore {word}: the file declares no loop or coupling of that name{near}")


def listed(declarations: Sequence[Declaration], most: int = 20) -> str:
    """Return labels with their lines, the first few of them."""
    return first_of([f"{d.label} (line {d.line})" if d.line else d.label for d in declarations], most)


def leave_out(element: str) -> str:
    """Return the remedy for an element that has no counterpart."""
    return f"leave it out with --ignore {shell_word(element)} (in Python ignore=[{element!r}])"


def tag_of(element: Any) -> str:
    """Return an element's tag as written."""
    return re.sub(r"\{.*\}", f"{element.prefix}:" if element.prefix else "", str(element.tag))


def local(element: Any) -> str:
    """Return an element's name in lower case, without a namespace or its prefix."""
    return re.split("[}:]", str(element.tag))[-1].lower()


def label_of(element: Any, simulator: str = "") -> str:
    """Return an element in a few words: its tag, its name, and the simulator's element around it."""
    name = f" '{element.get('name')}'" if element.get("name") else ""
    return f"<{tag_of(element)}>{name}{f' in <{simulator}>' if simulator else ''}"
