"""Masses of bars, and where the bars are: what follows from the numbers of a description alone.

Both are smooth functions of few numbers, without joints or loops: central differences of documents with other numbers
give their derivatives to about 1e-9.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.design.parameters import Parameters
from raff2urdf.graphics.meshes import Graphics
from raff2urdf.graphics.skeleton import SkeletonDrawing
from raff2urdf.raff.document import CompoundKind, Document, JointType, RaffLink, RaffPart
from raff2urdf.raff.masses import RaffMasses

_STEP = 1e-5  # characteristic lengths or rad
_LENGTHS = ("epsilon", "d", "r")  # of the bars to a child


def by_dimensions(parameters: Parameters, p: ArrayLike, function: Callable[[Document], Array]) -> tuple[Array, Array]:
    """Return a function of a document at values of the free parameters, and its derivative by them.

    Args:
        parameters: the free ones.
        p: (parameters,) m and rad.
        function: returns an array (...).

    Returns:
        (...) and (..., parameters).
    """
    values = parameters.checked(p)
    slopes = []
    for k, step in enumerate(_STEP * parameters.sizes):
        change = step * np.eye(len(values))[k]
        ahead, behind = (function(parameters.document_with(values + sign * change)) for sign in (1.0, -1.0))
        slopes.append((ahead - behind) / (2.0 * step))
    return function(parameters.document_with(values)), np.stack(slopes, axis=-1)


class LinkMass(NamedTuple):
    """Mass and centre of a link, and their derivatives by columns of a design.

    Attributes:
        mass: kg.
        centre: (3,) in the link's frame, m.
        mass_by: (columns,) by the columns, m and rad.
        centre_by: (3, columns).
    """

    mass: float
    centre: Array
    mass_by: Array
    centre_by: Array


class DimensionedMasses:
    """The masses of a robot's links as its file describes them, at any values of the parameters: those of bars of a
    density change with their lengths.

    Args:
        parameters: the free ones.

    Raises:
        RaffError: a density without a volume.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        robot = parameters.robot
        nodes = {node.node: node for node in robot.nodes.values()}
        self._bars = [name for name, node in nodes.items() if node.inertial and node.inertial.radius is not None]
        drawing = SkeletonDrawing(parameters.document, robot)
        masses = RaffMasses(parameters.document, Graphics(robot, parameters.folder), drawing)
        by_node = {name: masses.of(node) for name, node in nodes.items()}
        self._constant = {name: mass for name, mass in by_node.items() if mass is not None and name not in self._bars}

    @property
    def vary(self) -> bool:
        """True if a mass can depend on parameters."""
        return bool(self._bars)

    def at(self, p: ArrayLike) -> dict[str, LinkMass]:
        """Return the links' masses, by node, with derivatives by the free parameters, at their values (count,)."""
        constant = np.zeros(len(self.parameters)), np.zeros((3, len(self.parameters)))
        masses = {name: LinkMass(mass.mass, mass.centre, *constant) for name, mass in self._constant.items()}
        if self._bars:
            values, slopes = by_dimensions(self.parameters, p, self._of_bars)
            for name, value, slope in zip(self._bars, values, slopes, strict=True):
                masses[name] = LinkMass(float(value[0]), value[1:], slope[0], slope[1:])
        return masses

    def _of_bars(self, document: Document) -> Array:
        """Return the mass and centre (bars, 4) of the links that are bars. `RaffMasses` has them rounded to nine
        digits, too few for differences."""
        robot = document.robot(self.parameters.robot.name)
        drawing, rows = SkeletonDrawing(document, robot), []
        for node in robot.nodes.values():
            if node.node in self._bars and node.inertial is not None and node.inertial.density is not None:
                paths = [drawing.corners(child) for child in robot.children.get(node.number, [])]
                ends = np.array([pair for path in paths for pair in pairwise(path)])
                area = np.pi * document.metres(node.inertial.radius or 0.0) ** 2
                mass = node.inertial.density * area * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
                rows.append([mass.sum(), *(mass @ ends.mean(axis=1) / mass.sum())])
        return np.array(rows)


class Bar(NamedTuple):
    """A straight bar between two points, each on a node.

    Attributes:
        nodes: both.
        name: for messages.
    """

    nodes: tuple[str, str]
    name: str


class DimensionedBars:
    """The bars along a robot's parameters, from each node to its children, at any values of the parameters.

    Bars follow epsilon, d and r of a child, but run straight to a frame or a fixed link. Where a child slides on its
    parent, a bar leads to it.

    Args:
        parameters: the free ones.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        robot, varies = parameters.robot, (parameters.ties.matrix != 0.0).sum(axis=1)
        self.bars: list[Bar] = []
        self._ends: list[tuple[int, int]] = []  # child, and which of its corners begins the bar; -1 ends at the child
        written = SkeletonDrawing(parameters.document, robot)
        for child in robot.parts:
            parent = robot.nodes[child.pred].node
            corners = written.corners(child)
            free = [varies[parameters.find(f"{child.keyword}{child.number}.{word}")] > 0 for word in _LENGTHS]
            for k in range(len(corners) - 1):
                if (free[k] if len(corners) > 2 else any(free)) or np.abs(corners[k + 1] - corners[k]).max() > 0.0:
                    self.bars.append(Bar((parent, parent), f"{parent} to {child.node}"))
                    self._ends.append((child.number, k))
            if _slides(child):
                self.bars.append(Bar((parent, child.node), f"{parent} to {child.node}"))
                self._ends.append((child.number, -1))

    def at(self, p: ArrayLike) -> tuple[Array, Array]:
        """Return both ends (bars, 2, 3) of each bar in the frames of its nodes, m, and their derivatives
        (bars, 2, 3, parameters) by the free parameters, at their values (count,)."""
        return by_dimensions(self.parameters, p, self._in_document)

    def _in_document(self, document: Document) -> Array:
        robot = document.robot(self.parameters.robot.name)
        drawing = SkeletonDrawing(document, robot)
        corners = {part.number: drawing.corners(part) for part in robot.parts}
        return np.array(
            [
                [corners[child][-1], np.zeros(3)] if k < 0 else [corners[child][k], corners[child][k + 1]]
                for child, k in self._ends
            ]
        ).reshape(-1, 2, 3)


def _slides(child: RaffPart) -> bool:
    if not isinstance(child, RaffLink):
        return False
    return child.type is JointType.PRISMATIC or child.compound in (CompoundKind.CYLINDRICAL, CompoundKind.PLANAR)
