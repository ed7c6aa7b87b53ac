"""Tasks of a node, and the parts of a mechanism that bring it there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.assembly.modes import ModesSolver
from cinegen.errors import ClosureError
from cinegen.model import Mechanism

_ALIKE = 1e-6  # features


class NodeTask(NamedTuple):
    """A frame on a node is brought to a position; its orientation is given, free, or free about one of its axes.

    Attributes:
        node: name of the node.
        offset: pose of the frame on the node.
        rotation: number of constrained rotations: 3; 0; or 2, and then the orientation is free about `free_axis`.
        free_axis: (3,) in the frame.
    """

    node: str
    offset: pin.SE3
    rotation: int = 3
    free_axis: tuple[float, float, float] = (0.0, 0.0, 1.0)


class VirtualPose(NamedTuple):
    """The values of the virtual joints for a pose, and how far it is from all poses that the node's motions reach.

    Attributes:
        values: (count,) m and rad.
        distance: m.
        angle: rad.
    """

    values: Array
    distance: float
    angle: float


@dataclass(frozen=True, eq=False)
class TaskPart:
    """A linkage of some of the joints that bring the node to its pose.

    Attributes:
        mechanism: whose actuated joints are the virtual ones; without limits, by which only curves are measured:
            its couplings are linear.
        joints: names of its other joints.
        distinct: names of those whose values distinguish solutions: actuated ones, those in couplings, and those in no
            loop of the whole mechanism.
        solver: computes its modes.
    """

    mechanism: Mechanism
    joints: tuple[str, ...]
    distinct: tuple[str, ...]
    solver: ModesSolver

    def values(self, q: Array) -> dict[str, float]:
        """Return the values of its joints in its own configuration q (nq,), rad and m."""
        return {name: float(q[self.mechanism.q_index(name)]) for name in self.joints}

    def near(self, q: Array) -> Array:
        """Return q (nq,) itself, or what places all its links alike with the joints of universal and ball joints, and
        rods about themselves, nearer to home."""
        mechanism, features = self.mechanism, self.solver.features(q)
        kept = (*mechanism.actuated, *self.distinct)
        start = mechanism.configuration({name: float(q[mechanism.q_index(name)]) for name in kept})
        try:
            nearer = mechanism.close(start, kept)
        except ClosureError:
            return q
        alike = np.abs(self.solver.features(nearer) - features).max(initial=0.0) < _ALIKE
        home = mechanism.q_home
        return nearer if alike and mechanism.distance(home, nearer) < mechanism.distance(home, q) else q
