"""Read the loops and couplings of a URDF in all dialects together.

The dialects are those of the files next to a URDF (`sidecar`, `robot_yaml`, `loop_closures`), of joints that close
loops (`closing_joints`), of elements (`loop_elements`, `joint_couplings`) and of frames (`closing_frames`). What
`declared_loops` finds besides can't be read.

Several dialects may declare the same loop: it is read once. Of two declarations between the same two bodies, the one
that implies the other holds; two that contradict each other are an error.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from raff2urdf.errors import RaffError, warn
from raff2urdf.escape import shell_word, unique_name
from raff2urdf.readers import Description
from raff2urdf.readers.loops import (
    closing_frames,
    closing_joints,
    declared_loops,
    implausible,
    joint_couplings,
    loop_closures,
    loop_elements,
    roots,
    successive,
)
from raff2urdf.readers.loops.adjacent_files import AdjacentFiles
from raff2urdf.readers.loops.declaration import CouplingEntry, Declaration, IgnoreList, listed
from raff2urdf.readers.loops.loop_joint import LoopJoint, implies
from raff2urdf.readers.urdf import default_value, ends, joints, limits
from raff2urdf.readers.urdf import listed as urdf_joints
from raff2urdf.readers.urdf_file import parse, xacro_hint
from raff2urdf.readers.urdf_tree import UrdfTree, text_of
from raff2urdf.readers.xml_file import parse_xml


def read(text: str, path: Path, ignore: IgnoreList, ignore_loops: bool, is_file: bool = True) -> Description:
    """Read the loops and couplings of a URDF.

    Args:
        text: of the URDF.
        path: of the URDF.
        ignore: elements to be left out.
        ignore_loops: leave out all of them.
        is_file: whether files may be next to it; else its path is only a name, in errors.

    Raises:
        RaffError: the URDF or a file next to it is wrong; it declares a loop or a coupling that can't be read, and that
            is not ignored; two declarations contradict each other.
    """
    name = str(path)
    text, root, declared, free, notes = _declarations(text, name, ignore, ignore_loops)
    files = AdjacentFiles(path, text, ignore, ignore_loops, is_file)
    if ignore_loops:
        return _without_loops(files, declared, free, notes, name)
    left_out, kept = list[Declaration](), list[Declaration]()
    for declaration in declared:
        (left_out if ignore.takes(*declaration.words) else kept).append(declaration)
    tree = UrdfTree(parse(files.text, name), name)
    closures, made = files.closures(tree), list[str]()
    for joint in closures.spherical if closures is not None else ():
        made += successive.replace(tree.root, tree.joints[joint], successive.SPHERICAL, name)
    tree = UrdfTree(tree.root, name) if made else tree
    composed = _Composed(tree, files, made)
    composed.notes += notes
    if closures is not None:
        following = [mimic for mimic in kept if mimic.dialect == "mimic" and mimic.name in closures.following]
        kept = [declaration for declaration in kept if declaration not in following]
        composed.notes += [f"{_located(mimic)}: replaced by {loop_closures.FILE}" for mimic in following]
        composed.add_all([loop for loop in closures.declared if not ignore.takes(*loop.words)])
    composed.add_all([declaration for declaration in kept if declaration.read is not None])
    unread = [declaration for declaration in kept if declaration.read is None]
    _check_unread(unread, composed, root, path, is_file)
    if files.values is None and not files.left_out:
        _warn_of_missing(unread, path)
    if not left_out and not composed.closed and not composed.coupled:
        _warn_of_passive(root, name)
    if free:
        composed.place(free)
        _warn_of_reversed(free, kept, name)
    return composed.result((*map(_located, left_out), *files.left_out))


def _declarations(
    text: str, name: str, ignore: IgnoreList, ignore_loops: bool
) -> tuple[str, Any, list[Declaration], Sequence[str], Sequence[str]]:
    """Return a URDF as text and as XML, each link with one parent, all that it declares in the order of its lines, the
    joints by which its roots float, and notes."""
    root = parse_xml(text, name)
    changed = closing_joints.with_joints_of_drake(root, name)
    notes = [*roots.with_world(root), *implausible.mend(root), *closing_joints.without_links_of_gazebo(root)]
    free = roots.attach(root)
    declared = closing_joints.cut(root, name, lambda word: ignore_loops or ignore.takes(word))
    if changed or declared or notes or free:
        text = text_of(root)
    root = parse(text, name)
    for message in implausible.warnings_of(root, name):
        warn(message)
    declared += [
        *joint_couplings.find(root),
        *loop_elements.find(root),
        *closing_frames.find(root),
        *closing_joints.find(root, name),
    ]
    declared += declared_loops.find(root, {id(declaration.element) for declaration in declared})
    return text, root, sorted(declared, key=lambda declaration: declaration.line), free, notes


def _without_loops(
    files: AdjacentFiles, declared: Sequence[Declaration], free: Sequence[str], notes: Sequence[str], name: str
) -> Description:
    """Return a robot without its loops and couplings."""
    if free:
        tree = UrdfTree(parse(files.text, name), name)
        raise roots.refusal(tree, [ends(tree.joints[joint])[1] for joint in free])
    shown = [declaration for declaration in declared if declaration.certain and declaration.also != ("0",)]
    if files.values is not None:
        shown = [declaration for declaration in shown if declaration.dialect != declared_loops.COMMENT]
    return Description(files.text, files.values, (), tuple(notes), ((listed(shown),) if shown else ()) + files.left_out)


def _located(declaration: Declaration) -> str:
    return f"{declaration.label} (line {declaration.line})"


def _check_unread(unread: Sequence[Declaration], composed: _Composed, root: Any, path: Path, is_file: bool) -> None:
    """Refuse declarations that can't be read, or warn of those that may declare nothing."""
    lost = declared_loops.lost(unread, composed.spare, composed.closed)
    certain = [declaration for declaration in lost if declaration.certain]
    if certain:
        raise RaffError(f"{declared_loops.refusal(certain, path, is_file)}{xacro_hint(root, str(path))}")
    if lost:
        also = f". Also not read: {listed(lost[1:], 3)}" if lost[1:] else ""
        warn(f"{path}:{lost[0].line}: {lost[0].text}{also}")


def _warn_of_missing(unread: Sequence[Declaration], path: Path) -> None:
    """Warn of a constraints file that a comment names and that is not there, though no loop is lost."""
    for comment in unread:
        if comment.dialect == declared_loops.COMMENT:
            why = f"names {comment.name}, which is not there: home and actuated joints are the defaults"
            remedy = "Restore that file, or remove the comment"
            warn(f"{path}:{comment.line}: this comment {why}. {remedy}")


def _warn_of_passive(root: Any, name: str) -> None:
    """Warn of joints that depend on others according to URDF+, if nothing in the file declares how."""
    passive = [joint for joint in joints(root) if joint.get("independent") == "false"]
    if passive:
        why = 'the joint depends on others (independent="false"), but no <loop> and no <coupling> declares how'
        warn(f"{urdf_joints(passive, name)}: {why}; it moves freely")


def _warn_of_reversed(free: Sequence[str], declared: Sequence[Declaration], name: str) -> None:
    """Warn of trees that nothing but one joint holds, with its parent and child in each other's place."""
    closing = [joint for joint in declared if joint.dialect == closing_joints.DIALECT]
    if len(closing) != len(declared) or len(closing) != len(free):
        return
    for joint in closing:
        parent, child = ends(joint.element)
        if any(floating.startswith(f"{parent}_free") for floating in free):
            why = f"link '{parent}' has no parent, and its child '{child}' has two, so that {joint.label} closes a loop"
            remedy = "exchange its <parent> and <child>, if no loop is meant"
            warn(f"{name}:{joint.line}: {why}: {remedy}")


class _Composed:
    """Loops and couplings of several dialects, each once.

    Attributes:
        loops: entries of the loops.
        couplings: entries of the couplings.
        notes: about what was read.
    """

    def __init__(self, tree: UrdfTree, files: AdjacentFiles, passive: list[str]) -> None:
        self._tree, self._files, self._passive = tree, files, passive
        self._cuts: list[tuple[Declaration, LoopJoint]] = []
        self._equations: list[tuple[Declaration, CouplingEntry]] = []
        self._met: set[int] = set()  # loops that several dialects declare
        self.notes: list[str] = []
        self._dialects = [files.dialect] if files.values is not None else []
        for entry in (files.values or {}).get("loops", []):
            self.add(_of_file(files.dialect, entry["name"]), _cut_of(entry))
        for entry in files.checked:
            self.add(_of_file("robot.yaml", entry["name"]), _cut_of(entry))
        for entry in (files.values or {}).get("couplings", []):
            self.add(_of_file(files.dialect, entry["name"]), entry)

    @property
    def closed(self) -> int:
        """Number of loops and couplings."""
        return len(self._cuts) + len(self._equations)

    @property
    def coupled(self) -> int:
        """Number of couplings."""
        return len(self._equations)

    @property
    def spare(self) -> int:
        """Number of loops in files next to the URDF that no element declares, too."""
        return sum(not declared.line and i not in self._met for i, (declared, _) in enumerate(self._cuts))

    def add_all(self, declared: Iterable[Declaration]) -> None:
        """Read declarations and add them."""
        for declaration in declared:
            assert declaration.read is not None
            self.add(declaration, declaration.read(self._tree))

    def add(self, declared: Declaration, constraint: LoopJoint | CouplingEntry) -> None:
        """Add a loop or a coupling, unless it is there.

        Raises:
            RaffError: it contradicts one that another dialect declares.
        """
        self._dialects += [declared.dialect] if declared.dialect not in self._dialects else []
        if isinstance(constraint, LoopJoint):
            self._add_loop(declared, constraint)
        else:
            self._add_coupling(declared, constraint)

    def _add_loop(self, declared: Declaration, cut: LoopJoint) -> None:
        for i, (other, other_cut) in enumerate(self._cuts):
            held = implies(self._tree, other_cut, cut)
            if held is False and implies(self._tree, cut, other_cut):
                self._cuts[i], held = (replace(other, notes=declared.notes), cut), True
            if held:
                self._met.add(i)
                return
            if held is False and other.dialect != declared.dialect:
                raise self._contradiction(declared, other)
        self._cuts.append((declared, cut))

    def _add_coupling(self, declared: Declaration, entry: CouplingEntry) -> None:
        terms = _normal(entry)
        for other, other_entry in self._equations:
            other_terms = _normal(other_entry)
            if terms.keys() == other_terms.keys():
                if all(np.allclose(terms[key], other_terms[key], rtol=1e-9, atol=1e-12) for key in terms):
                    return
                if other.dialect != declared.dialect:
                    raise self._contradiction(declared, other)
        self._equations.append((declared, entry))

    def _contradiction(self, declared: Declaration, other: Declaration) -> RaffError:
        where = f"{self._tree.name}:{declared.line}" if declared.line else self._tree.name
        label = f"{other.label}{f' (line {other.line})' if other.line else ''}"
        word = next(word for word in (*declared.words, "") if word not in other.words)
        return RaffError(
            f"{where}: {declared.label} contradicts {label} of {other.dialect}: correct one of them, or leave it out "
            f"with --ignore {shell_word(word)}"
        )

    def place(self, free: Sequence[str]) -> None:
        """Place the trees of several roots, see `roots.place`."""
        self._tree, passive, notes = roots.place(self._tree, free, [cut for _, cut in self._cuts])
        self._passive += passive
        self.notes += notes

    def result(self, left_out: tuple[str, ...]) -> Description:
        """Return the URDF with everything that was added."""
        tree, files = self._tree, self._files
        if not self._cuts and not self._equations and files.values is None:
            return Description(files.text, None, (), tuple(self.notes), left_out)
        passive = list(self._passive)
        taken: set[str] = set()
        loops, screws = [], list[CouplingEntry]()
        for declared, cut in self._cuts:
            name = _free(declared.name or f"{cut.first}-{cut.second}", taken)
            entry, added = cut.add_to(tree, name)
            self.notes += declared.notes
            passive += added
            loops.append(entry)
            screws += cut.couplings(name, added)
        couplings = [{**entry, "name": _free(entry["name"], taken)} for _, entry in self._in_order()]
        couplings += [{**entry, "name": _free(entry["name"], taken)} for entry in screws]
        text = text_of(tree.root) if passive else files.text
        values = dict(files.values or {})
        values["loops"] = loops
        if couplings:
            values["couplings"] = couplings
        values["joints"] = self._joints(text, passive)
        return Description(text, values, tuple(self._dialects), tuple(self.notes), left_out)

    def _in_order(self) -> list[tuple[Declaration, CouplingEntry]]:
        """Return the couplings: those of a file as there, then each behind those that drive its joints."""
        ordered = [pair for pair in self._equations if not pair[0].line]
        pending = [pair for pair in self._equations if pair[0].line]
        while pending:
            following = {entry["terms"][0]["joint"] for _, entry in pending}
            first = next(
                (p for p in pending if not following & {term["joint"] for term in p[1]["terms"][1:]}), pending[0]
            )
            ordered.append(first)
            pending = [pair for pair in pending if pair is not first]
        return ordered

    def _joints(self, text: str, passive: Sequence[str]) -> list[dict[str, Any]]:
        """Return the entries of all joints that move: those of a file, and passive ones behind them."""
        of_file = list((self._files.values or {}).get("joints", []))
        if of_file:
            unstated = {} if any("actuated" in entry for entry in of_file) or not passive else {"actuated": None}
            known = {entry["name"]: {**unstated, **entry} for entry in of_file}
            known |= {
                joint: {"home": 0.0, **known.get(joint, {}), "name": joint, "actuated": False} for joint in passive
            }
            return list(known.values())
        closures = self._files.closures(self._tree)
        root = self._tree.root
        by_name = {str(joint.get("name")): joint for joint in joints(root)}
        moving = successive.moving(text, self._tree.name)
        driven = None if closures is None else closures.actuated
        dependent = {name for name, joint in by_name.items() if joint.get("independent") == "false"} | {*passive}
        entries = []
        for joint in moving:
            entry: dict[str, Any] = {"name": joint}
            if not self._cuts and joint in by_name:  # without loops, 0 is as good as anything else
                entry["home"] = default_value(limits(by_name[joint]))
            if driven is not None:
                entry["actuated"] = joint in driven
            elif dependent:
                entry["actuated"] = False if joint in dependent else None
            entries.append(entry)
        return entries


def _of_file(dialect: str, name: str) -> Declaration:
    label = f"loop '{name}'"
    return Declaration(0, dialect, label, f"{label} of {dialect}", name)


def _cut_of(entry: Mapping[str, Any]) -> LoopJoint:
    """Return the joint of a loop's entry."""
    first, second = entry["first"], entry["second"]
    placed = (np.array(first["placement"], dtype=float), np.array(second["placement"], dtype=float))
    return LoopJoint(entry["kind"], first["node"], second["node"], placed)


def _normal(entry: CouplingEntry) -> dict[str, list[float]]:
    """Return the coefficients of a coupling by joint, and its constant by "", in parts of the first joint's."""
    terms = {str(term["joint"]): [float(c) for c in term["coefficients"]] for term in entry["terms"]}
    unit = next(c for c in terms[min(terms)] if c)
    powers = max(map(len, terms.values()))
    scaled = {joint: [c / unit for c in (*row, *[0.0] * (powers - len(row)))] for joint, row in terms.items()}
    return {**scaled, "": [float(entry.get("constant", 0.0)) / unit]}


def _free(name: str, taken: set[str]) -> str:
    """Return a name that is not taken, and take it: NAME, or NAME#2 and so on."""
    free = unique_name(name, taken)
    taken.add(free)
    return free
