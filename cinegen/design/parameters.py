"""`Parameters`: every number of a robot's description that places one node on another, as a variable.

Names are those that RAFF writes: `link2.d`, `frame9.theta`, `base.r`; a node's own name serves too (`tool.d`). Values
are in m and rad. A moving joint's own `theta` or `r` is its variable: the number in the file is only its home, and as a
parameter it is the offset of the joint's encoder, which is 0 at the value that is written.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import translate
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

import raff2urdf
from cinegen.arrays import Array, ArrayLike
from cinegen.design.errors import DesignError
from cinegen.design.ties import Ties, resolve
from cinegen.errors import read_all, warn
from cinegen.model.build import build
from cinegen.model.mechanism import Mechanism
from raff2urdf.conversion import describe
from raff2urdf.errors import counted, did_you_mean, first_of
from raff2urdf.quantities import ANGLE, LENGTH, Dimension, parse, parse_range, refused_as, shown
from raff2urdf.raff.compound import VARIABLES
from raff2urdf.raff.document import UNITS_PER_METRE, Document, JointType, RaffBase, RaffLink, RaffNode, RaffRobot
from raff2urdf.raff.kleinfinger import Kleinfinger
from raff2urdf.shipped import find_robot
from raff2urdf.tree import kleinfinger

WORDS = Kleinfinger._fields
"""Kleinfinger's six parameters, in the order in which they place a node on its parent."""

_LENGTHS = ("epsilon", "d", "r")
_DIGITS = 15  # significant, of a number that is written


_TIED = 4  # names of parameters that are tied are all shown up to this many


def is_pattern(text: str) -> bool:
    """Return whether a name has wildcards."""
    return re.search(r"[*?[]", text) is not None


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of a robot's description.

    Attributes:
        name: as RAFF writes it, such as `link2.d`.
        node: the number of its node; 0 is the base.
        word: `gamma`, `epsilon`, `alpha`, `d`, `theta` or `r`.
        value: in the file, m or rad.
        joint: the joint whose variable it is, if it is one: then it is the offset of that joint's encoder. Else "".
        alias: name with the node's own name.
    """

    name: str
    node: int
    word: str
    value: float
    joint: str
    alias: str

    @property
    def dimension(self) -> Dimension:
        """Length or angle."""
        return LENGTH if self.word in _LENGTHS else ANGLE

    @property
    def unit(self) -> str:
        """Unit of its values: m or rad."""
        return "m" if self.word in _LENGTHS else "rad"


class Parameters:
    """The free parameters of a robot, and how all others follow from them.

    Args:
        source: a RAFF file, the name of a shipped robot, a URDF, SDF or MJCF (which is converted by `urdf2raff`), or a
            document.
        names: patterns of the parameters that vary, such as `link*.d`; by default all but joints' own variables, which
            only their full names choose.
        ties: see `cinegen.design.ties`.
        bounds: of free parameters, by pattern: (low, high) in m or rad, or a text such as "100..200mm".
        robot: name of one robot of a file that holds several.
        loops: kinds of closure that replace those of the file, by the loop's name.

    Attributes:
        document: the file's contents.
        folder: of the file's graphics.
        robot: the robot.
        all: every parameter of the description, in the order of the file.
        free: those that vary.
        names: of these.
        values: (count,) of the free parameters in the file, m and rad; read-only.
        bounds: (count, 2) low and high; infinite where there are none; read-only.
        mechanism: the robot as the file describes it.

    Raises:
        DesignError: an unknown name; ties that contradict each other; a bound with a wrong unit, or one that the file's
            own value violates; nothing varies.
        raff2urdf.RaffError: the file is wrong.
    """

    def __init__(
        self,
        source: str | Path | Document,
        names: str | Iterable[str] = "*",
        ties: Iterable[str] = (),
        bounds: Mapping[str, tuple[float, float] | str] | None = None,
        robot: str | None = None,
        loops: Mapping[str, str] | None = None,
    ) -> None:
        self.document, self.folder = _document(source)
        raff2urdf.check(self.document)
        self.robot = self.document.robot(robot)
        self._loops = loops
        self.all = tuple(_parameters(self.document, self.robot))
        self._index = {parameter.name: i for i, parameter in enumerate(self.all)}
        self._index = {parameter.alias: i for i, parameter in enumerate(self.all)} | self._index
        self._relax: bool | None = None  # nominal loops may be healed; those of other values only if these are
        self.mechanism = self._built(self.document)
        texts = (ties,) if isinstance(ties, str) else tuple(ties)
        tied = resolve(texts, self.find, [parameter.dimension for parameter in self.all])
        chosen = set(self.matching((names,) if isinstance(names, str) else names))
        varying = [k for k, i in enumerate(tied.free) if i in chosen or (tied.matrix[sorted(chosen), k] != 0.0).any()]
        if not varying:
            raise DesignError(
                f"{self.robot.name}: every parameter that was named is tied to a constant: nothing varies"
            )
        written = np.array([parameter.value for parameter in self.all])
        self._free = tuple(tied.free[k] for k in varying)
        others = np.setdiff1d(np.arange(len(tied.free)), varying)
        fixed = tied.constant + tied.matrix[:, others] @ written[[tied.free[k] for k in others]]
        self.ties = Ties(self._free, tied.matrix[:, varying], fixed)
        self.free = tuple(self.all[i] for i in self._free)
        self.names = tuple(parameter.name for parameter in self.free)
        self.values = written[list(self._free)]
        self._warn_of_changes(written)
        self.bounds = self._bounds(bounds or {})
        self.values.flags.writeable = self.bounds.flags.writeable = False

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        return f"<Parameters of {self.robot.name}: {len(self.names)} free of {len(self.all)}>"

    @property
    def sizes(self) -> Array:
        """(count,) one dimensionless step of each free parameter: the characteristic length, or 1 rad."""
        return np.array([self.mechanism.length if parameter.unit == "m" else 1.0 for parameter in self.free])

    # --- names ---------------------------------------------------------------------------------------------------

    def find(self, name: str) -> int:
        """Return the index in `all` of a parameter's name.

        Raises:
            DesignError: unknown; suggests the nearest.
        """
        index = self._index.get(name.strip())
        if index is None:
            node, _, word = name.strip().rpartition(".")
            known = [each.name for each in self.all]
            if node in {each.rpartition(".")[0] for each in self._index}:
                raise DesignError(f"{node} has no parameter '{word}'{did_you_mean(word, WORDS)}")
            raise DesignError(f"{self.robot.name} has no parameter '{name}'{did_you_mean(name, known)}")
        return index

    def index(self, name: str) -> int:
        """Return the index of a free parameter in `names` and `values`.

        Raises:
            DesignError: unknown, or not free.
        """
        position = self.find(name)
        if position not in self._free:
            raise DesignError(f"{name} is not free here: it is tied to others, fixed, or was not named")
        return self._free.index(position)

    def tied_name(self, index: int) -> str:
        """Return the name of a free parameter with those that are equal to it but for sign and offset: `link2.d =
        link7.d`."""
        alone = (self.ties.matrix != 0.0).sum(axis=1) == 1
        names = [self.all[i].name for i in np.flatnonzero(alone & (np.abs(self.ties.matrix[:, index]) == 1.0))]
        more = f" = ... ({len(names)})" if len(names) > _TIED else ""
        return " = ".join(names[:_TIED]) + more

    def matching(self, patterns: Iterable[str]) -> list[int]:
        """Return the indices in `all` of the parameters that patterns such as `link*.d` match, in the file's order. A
        joint's own variable is matched by its full name only.

        Raises:
            DesignError: patterns match nothing; names all of them.
        """
        reads = {pattern: partial(self._matched, pattern.strip()) for pattern in patterns}
        return sorted({*chain.from_iterable(read_all(reads, DesignError).values())})

    def _matched(self, pattern: str) -> list[int]:
        if not is_pattern(pattern):
            return [self.find(pattern)]
        matches = re.compile(translate(pattern)).match
        both = [i for i, each in enumerate(self.all) if any(map(matches, (each.name, each.alias)))]
        matched = [i for i in both if not self.all[i].joint]
        if not matched:
            why = "matches no parameter"
            if both:
                of = ", ".join(self.all[i].name for i in both[:6])
                why = f"matches only variables of moving joints ({of}), whose written value is their home: name them"
            raise DesignError(
                f"'{pattern}' {why}; parameters are NODE.WORD, such as link2.d (words: {', '.join(WORDS)})"
                f"{'' if both else did_you_mean(pattern, [parameter.name for parameter in self.all])}"
            )
        return matched

    def own_variable(self, joint: str) -> Parameter:
        """Return the parameter that is the offset of a joint's encoder.

        Raises:
            DesignError: no such joint, or its variable is no parameter.
        """
        variable = next((parameter for parameter in self.all if parameter.joint == joint), None)
        if variable is None:
            if joint in self.mechanism.joints:
                raise DesignError(f"{joint}: the offset of its encoder is no parameter: only theta and r of a link are")
            known = [parameter.joint for parameter in self.all if parameter.joint]
            raise DesignError(f"{self.robot.name} has no joint '{joint}'{did_you_mean(joint, known)}")
        return variable

    # --- values --------------------------------------------------------------------------------------------------

    def checked(self, p: ArrayLike) -> Array:
        """Return values of the free parameters as an array (count,) of finite numbers.

        Raises:
            DesignError: another shape, or a number that is not finite.
        """
        values = np.asarray(p, dtype=float)
        if values.shape != (len(self.names),) or not np.isfinite(values).all():
            raise DesignError(f"{self!r} takes {counted(len(self.names), 'finite number')}, not {str(p)[:60]}")
        return values

    def with_changed(self, changes: Mapping[str, float | str]) -> Array:
        """Return values of the free parameters: the file's, but for some: m and rad, or a text such as "1510mm".

        Raises:
            DesignError: unknown, not free, or a wrong unit.
        """
        values = self.values.copy()
        for name, value in changes.items():
            i = self.index(name)
            values[i] = self._parsed(name, value) if isinstance(value, str) else float(value)
        return self.checked(values)

    def full(self, p: ArrayLike) -> Array:
        """Return the values of all parameters, (len(all),) or (n, len(all)), for those of the free ones (count,) or
        (n, count)."""
        return np.asarray(np.asarray(p, dtype=float) @ self.ties.matrix.T + self.ties.constant)

    def document_with(self, p: ArrayLike) -> Document:
        """Return the document with other values of the free parameters (count,); a joint's own variable changes the
        home that is written."""
        full = self.full(self.checked(p))
        nodes: dict[int, dict[str, float]] = {}
        for parameter, value in zip(self.all, full.tolist(), strict=True):
            if value != parameter.value:
                nodes.setdefault(parameter.node, {})[parameter.word] = self._in_file(parameter, value)
        return _replaced(self.document, self.robot, nodes)

    def mechanism_with(self, p: ArrayLike) -> Mechanism:
        """Return the mechanism with other values of the free parameters (count,), as if their file were loaded: a
        complete one for every analysis. For thousands of values see `cinegen.design.Design`.

        Raises:
            ClosureError: its loops can't be closed.
        """
        return self._built(self.document_with(p))

    def with_values(self, p: ArrayLike) -> str:
        """Return the text of the RAFF file with other values of the free parameters (count,). Comments and formatting
        stay, and numbers that do not change are not touched."""
        from cinegen.design.rewriting import rewritten

        return rewritten(self.document, self.document_with(p), self.robot.name)

    def text(self, name: str, value: float, digits: int = 6) -> str:
        """Return a value of a parameter, m or rad, as people read it."""
        return shown(value, self.all[self.find(name)].dimension, digits)

    def _in_file(self, parameter: Parameter, value: float) -> float:
        scale = UNITS_PER_METRE[self.document.units] if parameter.dimension is LENGTH else math.degrees(1.0)
        return float(f"{value * scale:.{_DIGITS}g}") + 0.0

    def _parsed(self, name: str, text: str) -> float:
        with refused_as(DesignError, name):
            return parse(text, self.all[self.find(name)].dimension)

    def _built(self, document: Document) -> Mechanism:
        urdf, constraints = describe(document, document.robot(self.robot.name), self.folder, self._loops)
        mechanism = build(urdf, constraints, name=self.document.source.name, relax=self._relax)
        if document is self.document and mechanism.source.urdf == urdf:
            self._relax = False
        return mechanism

    def _bounds(self, bounds: Mapping[str, tuple[float, float] | str]) -> Array:
        limits = np.tile([-np.inf, np.inf], (len(self.names), 1))
        read_all({text: partial(self._bound, limits, text, each) for text, each in bounds.items()}, DesignError)
        return limits

    def _bound(self, limits: Array, pattern: str, interval: tuple[float, float] | str) -> None:
        for i in self.matching([pattern]):
            if i not in self._free:
                if is_pattern(pattern):
                    continue
                self.index(self.all[i].name)
            k = self._free.index(i)
            parameter = self.free[k]
            with refused_as(DesignError, f"bounds of {parameter.name}"):
                low, high = parse_range(interval, parameter.dimension) if isinstance(interval, str) else interval
            if not low < high:
                raise DesignError(f"bounds of {parameter.name}: {low:g} is not below {high:g}")
            if not low <= self.values[k] <= high:
                texts = [shown(x, parameter.dimension) for x in (self.values[k], low, high)]
                raise DesignError(
                    f"{parameter.name} is {texts[0]} in the file, outside its bounds {texts[1]} to {texts[2]}"
                )
            limits[k] = low, high

    def _warn_of_changes(self, written: Array) -> None:
        full = self.full(self.values)
        changed = [i for i in range(len(full)) if abs(full[i] - written[i]) > 1e-12]
        if changed:
            listed = [
                f"{self.all[i].name} from {self.text(self.all[i].name, written[i])} to "
                f"{self.text(self.all[i].name, full[i])}"
                for i in changed
            ]
            warn(f"{self.robot.name}: the ties change values of the file: {first_of(listed, 6)}")


def _document(source: str | Path | Document) -> tuple[Document, Path]:
    """Return the document of a file, and the folder of its graphics."""
    if isinstance(source, Document):
        return source, Path(source.source.name).parent
    path = find_robot(source)
    if raff2urdf.readers.holds_xml(path):
        from raff2urdf.urdf2raff.conversion import to_raff

        return to_raff(path).document, path.parent
    return raff2urdf.load(path), path.parent


def _parameters(document: Document, robot: RaffRobot) -> Iterable[Parameter]:
    for node in robot.nodes.values():
        written = kleinfinger(document, node.parameters)
        keyword = f"{node.keyword}{node.number}" if node.number else "base"
        for word in WORDS:
            value = float(getattr(written, word))
            yield Parameter(f"{keyword}.{word}", node.number, word, value, _joint_of(node, word), f"{node.node}.{word}")


def _joint_of(node: RaffNode, word: str) -> str:
    """Return the joint whose variable a parameter is, or ""."""
    if not isinstance(node, RaffLink):
        return ""
    if node.compound is not None:
        from raff2urdf.raff.compound import joint_of

        names = [name for name, variable in VARIABLES[node.compound].items() if variable == word]
        return joint_of(node, names[0]) if names else ""
    variable = {JointType.REVOLUTE: "theta", JointType.PRISMATIC: "r"}.get(node.type)
    return node.joint if variable == word else ""


def _replaced(document: Document, robot: RaffRobot, changes: Mapping[int, Mapping[str, float]]) -> Document:
    def changed(node: Any) -> Any:
        if node.number not in changes:
            return node
        return replace(node, parameters=replace(node.parameters, **changes[node.number]))

    base: RaffBase = changed(robot.base)
    changed_robot = replace(robot, base=base, parts=tuple(changed(part) for part in robot.parts))
    robots: Sequence[RaffRobot] = [changed_robot if each.name == robot.name else each for each in document.robots]
    return replace(document, robots=tuple(robots))
