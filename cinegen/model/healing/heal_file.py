"""Heal the files of a robot: the smallest change of their numbers that makes nearly redundant loops exact."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, Indices
from cinegen.errors import CinegenError, LoadError
from cinegen.joints import axis
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.clusters import subsystems
from cinegen.model.build import written_loops
from cinegen.model.healing.heal import LARGEST_CHANGE, heal, in_bodies
from cinegen.model.healing.near_redundant import loop_gaps
from cinegen.model.load import load_with
from raff2urdf import closure, readers
from raff2urdf.constraints import HASH
from raff2urdf.conversion import describe
from raff2urdf.errors import RaffError
from raff2urdf.files import STANDARD
from raff2urdf.loops.near_redundancy import NearRedundancy, near_redundancy
from raff2urdf.raff.reader import parse, read
from raff2urdf.readers.loops import robot_yaml
from raff2urdf.readers.loops.sidecar import constraints_of
from raff2urdf.readers.options import ReadOptions
from raff2urdf.readers.urdf import hash_of
from raff2urdf.readers.urdf_file import parse as parse_urdf
from raff2urdf.readers.written_numbers import Adjustable, WrittenNumber, adjustables, rewritten

_DIFFERENCE = 1e-7  # rad or lengths: change of a number by which its effect is found
_NO_EFFECT = 1e-6  # of a twist by a change of that size, relative to it
_PARTS = (1e-2, 1e-4, 1e-6)  # numbers that change by less than such a part of the largest change are kept, if possible
_ZERO = 1e-13  # rad or m: smaller numbers are written as 0
_ROUNDING = 1e-15  # rad or lengths: smaller changes are not written


class HealedNumber(NamedTuple):
    """A number that was changed: as it was written, its new value, and the change in m or rad."""

    number: WrittenNumber
    value: float

    @property
    def change(self) -> float:
        """The change, m or rad."""
        return (self.value - self.number.value) * self.number.scale


class Healing(NamedTuple):
    """Healed files.

    Attributes:
        contents: of the robot's file, and of its constraints file if it has one; only numbers differ.
        numbers: that were changed.
        gaps: by which each nearly redundant loop was open, by name: (m, rad).
    """

    contents: dict[Path, bytes]
    numbers: tuple[HealedNumber, ...]
    gaps: dict[str, tuple[float, float]]


def heal_file(
    path: Path, robot: str | None = None, out: Path | None = None, options: ReadOptions | None = None
) -> Healing:
    """Heal a robot's RAFF file, URDF with its constraints file, SDF or MJCF.

    Numbers that place joints and ends of loops change as little as possible: least squares, angles in rad, lengths in
    characteristic lengths. Where fewer numbers suffice, the others stay.

    Args:
        path: of the file.
        robot: its name; the first of the file unless given.
        out: where the healed file will be written; over `path` unless given. Its constraints file will be next to it.
        options: of how the file is read.

    Raises:
        CinegenError: no loop is nearly redundant; no change as small as rounding makes the loops exact; or the healed
            file, read at `out`, has not the same loops, or can't be closed.
        LoadError, raff2urdf.RaffError: the file is wrong.
    """
    if path == STANDARD or path.suffix == ".xacro":
        why = "standard input can't be read again" if path == STANDARD else "its numbers are computed: expand it first"
        raise CinegenError(f"{path}: can't be healed: {why}")
    groups, options = adjustables(path), options or ReadOptions()
    with warnings.catch_warnings(), TemporaryDirectory() as folder:
        warnings.simplefilter("ignore")  # `load` warns
        files = _Files(path, robot, groups, Path(folder), options)
        healing = files.heal()
        _check(healing, path, path if out is None or out == STANDARD else out, robot, files.loops, options)
        options.check(path)
        return healing


def _check(
    healing: Healing, path: Path, out: Path, robot: str | None, loops: Sequence[str], options: ReadOptions
) -> None:
    """Load the healed files as they will be at `out`, and close the loops, which are to have these names."""
    names = {path: out.name, constraints_of(path): constraints_of(out).name}
    with TemporaryDirectory() as name:
        folder = _copy_of(out.absolute().parent, Path(name))
        for file, content in healing.contents.items():
            _replace(folder / names[file], content)
        try:
            kept = {loop.name for loop in load_with(options, folder / out.name, robot=robot, relax=False).loops}
        except (CinegenError, RaffError) as error:
            why = str(error).replace(f"{folder}/", "")
            raise CinegenError(f"{path}: not healed, since what would be written can't be loaded: {why}") from None
    if lost := [f"'{loop}'" for loop in loops if loop not in kept]:
        yaml = robot_yaml.sidecar_of(path)
        declaring = yaml.name if yaml is not None else "the file next to it that declares them"
        where = out.with_suffix(".yaml").name if yaml is not None and yaml.stem == path.stem else "that folder"
        raise CinegenError(f"{out}: would lack the loops {', '.join(lost)}: copy {declaring} to {where} first")


def _copy_of(folder: Path, copy: Path) -> Path:
    """Fill a folder with links to what is in another one."""
    for other in folder.iterdir() if folder.is_dir() else ():
        (copy / other.name).symlink_to(other)
    return copy


def _replace(file: Path, content: bytes) -> None:
    """Write a file in the place of a link."""
    file.unlink(missing_ok=True)
    file.write_bytes(content)


def _description(path: Path, robot: str | None, options: ReadOptions) -> tuple[str, Mapping[str, Any] | None]:
    """Return a robot as a URDF's text and its constraints."""
    if readers.holds_xml(path):
        description = readers.read(path, robot, options=options)
        return description.urdf, description.constraints
    document = parse(read(path), str(path))
    return describe(document, document.robot(robot), path.parent)


class _Files:
    """A robot's files, read again and again with other numbers.

    Args:
        path: of the robot's file.
        robot: its name.
        groups: its numbers.
        folder: where changed files are written.
        options: of how the file is read.
    """

    def __init__(
        self, path: Path, robot: str | None, groups: Sequence[Adjustable], folder: Path, options: ReadOptions
    ) -> None:
        self.path, self.robot, self.folder, self.options = path, robot, folder, options
        self.groups = list(groups)
        _description(path, robot, options)  # errors name the file itself
        _copy_of(path.absolute().parent, folder)
        system, q = self._loops([group.values([0.0] * len(group.is_length)) for group in self.groups])
        self.length, self.loops = system.length, [loop.name for loop in system.loops]
        self.clusters: list[int] = []
        self.redundancies: list[NearRedundancy] = []
        self.gaps: dict[str, tuple[float, float]] = {}
        for i, (cluster, at) in enumerate(subsystems(system)):
            redundancy = near_redundancy(cluster, closure.close(cluster, q[at]).q, q[at])
            if redundancy is not None:
                self.clusters.append(i)
                self.redundancies.append(redundancy)
                self.gaps |= loop_gaps(cluster, redundancy)
        if not self.redundancies:
            raise CinegenError(f"{path}: no loop is nearly redundant: there is nothing to heal")

    def heal(self) -> Healing:
        """Return the healed files."""
        base = self._make([])
        where = [(g, k) for g, group in enumerate(self.groups) for k in range(len(group.is_length))]
        columns = [np.concatenate([t.ravel() for t in self._effect(base, place)]) for place in where]
        used = [i for i, column in enumerate(columns) if np.abs(column).max() > _NO_EFFECT]
        where, columns = [where[i] for i in used], [columns[i] for i in used]
        if not where:
            raise self._hopeless()
        ends = np.cumsum([len(twists) * 6 for twists in self._twists(base, base)])[:-1]
        directions = np.split(np.array(columns).T, ends)

        def solve(chosen: Indices) -> tuple[Array, float]:
            parts = [direction[:, chosen] for direction in directions]
            places = [where[i] for i in chosen]
            change, gap = heal(self.redundancies, lambda x: self._make([*zip(places, x.tolist(), strict=True)]), parts)
            whole = np.zeros(len(where))
            whole[chosen] = change
            return whole, gap

        change, gap = solve(np.arange(len(where)))
        largest = np.abs(change).max()
        for part in _PARTS:
            fewer, its_gap = solve(np.flatnonzero(np.abs(change) > part * largest))
            if its_gap <= max(2.0 * gap, 1e-13) and np.abs(fewer).max() <= 1.5 * largest:
                change = fewer
                break
        change[np.abs(change) < _ROUNDING] = 0.0
        if not np.abs(change).max() <= LARGEST_CHANGE:
            raise self._hopeless()
        values = self._values(list(zip(where, change.tolist(), strict=True)))
        for group, new in zip(self.groups, values, strict=True):
            for k, number in enumerate(group.numbers):
                if new[k] != number.value and abs(new[k] * number.scale) < _ZERO:
                    new[k] = 0.0
        return self._checked(values)

    def _checked(self, values: list[list[float]]) -> Healing:
        """Return files with these numbers, once they are exact."""
        system, q = self._loops(values)
        for i, (cluster, at) in enumerate(subsystems(system)):
            closing = closure.close_from_afar(cluster, q[at])
            if i in self.clusters and (not closing.closed or near_redundancy(cluster, closing.q) is not None):
                raise self._hopeless()
        numbers = [number for group in self.groups for number in group.numbers]
        flat = [value for group in values for value in group]
        healed = [HealedNumber(n, v) for n, v in zip(numbers, flat, strict=True) if v != n.value]
        return Healing(self._with_hash(rewritten(numbers, flat)), tuple(healed), self.gaps)

    def _with_hash(self, contents: dict[Path, bytes]) -> dict[Path, bytes]:
        """Return files whose constraints name the healed URDF."""
        sidecar, urdf = constraints_of(self.path), contents.get(self.path)
        if sidecar not in contents or urdf is None:
            return contents
        urdf_hash = hash_of(parse_urdf(urdf.decode(), str(self.path)), str(self.path))
        named = re.sub(rb'("%s"\s*:\s*")[^"]*' % HASH.encode(), rb"\g<1>" + urdf_hash.encode(), contents[sidecar])
        return contents | {sidecar: named}

    def _hopeless(self) -> CinegenError:
        loops = ", ".join(f"'{name}'" for name in self.gaps)
        return CinegenError(
            f"{self.path}: no small change of the numbers makes these loops exact: {loops}: check their geometry, or "
            "load the robot with weaker joints there (--relax, or --loop NAME=ball, of the other commands)"
        )

    def _values(self, changes: Sequence[tuple[tuple[int, int], float]]) -> list[list[float]]:
        """Return all numbers after changes of some, in rad and characteristic lengths."""
        steps = [[0.0] * len(group.is_length) for group in self.groups]
        for (g, k), value in changes:
            steps[g][k] = value * (self.length if self.groups[g].is_length[k] else 1.0)
        pairs = zip(self.groups, steps, strict=True)
        return [group.values(s) if any(s) else [n.value for n in group.numbers] for group, s in pairs]

    def _make(self, changes: Sequence[tuple[tuple[int, int], float]]) -> list[ClosedLoops]:
        """Return the nearly redundant clusters after changes of numbers."""
        parts = subsystems(self._loops(self._values(changes))[0])
        return [parts[i][0] for i in self.clusters]

    def _loops(self, values: list[list[float]]) -> tuple[ClosedLoops, Array]:
        """Return the loops of files with these numbers, and the configuration (nq,) as written."""
        numbers = [number for group in self.groups for number in group.numbers]
        for file, content in rewritten(numbers, [value for group in values for value in group]).items():
            _replace(self.folder / file.name, content)
        urdf, constraints = _description(self.folder / self.path.name, self.robot, self.options)
        if not constraints or not constraints["loops"]:
            raise LoadError(f"{self.path}: it has no loops: there is nothing to heal")
        return written_loops(urdf, constraints, str(self.path))[:2]

    def _effect(self, base: list[ClosedLoops], place: tuple[int, int]) -> list[Array]:
        """Return the twists (n, 6) of each cluster that a change of one number causes, by its size."""
        return [twists / _DIFFERENCE for twists in self._twists(base, self._make([(place, _DIFFERENCE)]))]

    @staticmethod
    def _twists(base: list[ClosedLoops], other: list[ClosedLoops]) -> list[Array]:
        """Return the twists from one geometry to another, for each cluster, in bodies' frames; see `healing`."""
        by_cluster = []
        for old, new in zip(base, other, strict=True):
            before, behind = [], []
            for j in range(1, old.model.njoints):
                turn = np.zeros(3)
                if old.model.joints[j].nv == 1:  # another axis is another placement, undone behind the joint
                    turn = np.cross(axis(old.model.joints[j]), axis(new.model.joints[j]))
                turned = pin.SE3(pin.exp3(turn), np.zeros(3))
                step = old.model.jointPlacements[j].actInv(new.model.jointPlacements[j]) * turned
                before.append(pin.log6(step).vector)
                behind.append(np.concatenate([np.zeros(3), -turn]))
            pairs = list(zip(old.anchors, new.anchors, strict=True))
            ends = [pin.log6(a[1].actInv(b[1])).vector for a, b in pairs]
            ends += [pin.log6(a[3].actInv(b[3])).vector for a, b in pairs]
            twists = np.array([*before, *behind, *ends]) / np.repeat([old.length, 1.0], 3)
            by_cluster.append(in_bodies(old, twists.reshape(-1, 1)).reshape(-1, 6))
        return by_cluster
