"""Frames that are estimated with a robot: where a measuring device stands, and where its target is on a node.

A device D reads a target P on a node X in its own axes: D^-1 X P. Either is a parameter of six components: a
translation, and a rotation vector, from a start that the readings give at the robot's nominal parameters: D in the
world's axes, P in the node's. With a reading's derivative (a, b) by the twist of the target, at its origin x in the
world's axes, the derivatives are

    node (a, b + R c x a),    device -(a, b + (x - t) x a),    target (R^T a, R^T b),

where R is the rotation of the node, c the target's origin in its axes, t the device's in the world.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares

from cinegen.arrays import Array
from cinegen.design.calibration.measurements import COORDINATES, MeasuredQuantity
from cinegen.design.calibration.reading import read
from cinegen.design.errors import DesignError
from cinegen.errors import warn
from raff2urdf.quantities import ANGLE, LENGTH, Dimension

UNITS = {
    LENGTH: (
        *(("mm", "m", 1e3), ("m", "mm", 1e-3), ("mm", "in", 25.4), ("in", "mm", 1.0 / 25.4)),
        *(("mm", "cm", 10.0), ("cm", "mm", 0.1)),
    ),
    ANGLE: (
        *(("deg", "rad", float(np.degrees(1.0))), ("rad", "deg", float(np.radians(1.0)))),
        *(("deg", "gon", 0.9), ("rad", "gon", float(np.pi / 200.0))),
    ),
}
"""Units in which numbers were read and may have been meant, and the factor between, by dimension."""

_FEWEST = 3  # positions that place a device
_ROUNDS, _NEAR = 5, 3.0  # of placing a device, each without what is farther off than this many medians
_SCALED = 0.2  # deviation of a scale from that of another unit
_TURNED = 0.02  # root mean square rotation, rad, below which a node does not rotate
_EXPECTED = 1e-3  # characteristic lengths and rad: what errors of the robot make of readings, at first


class Seen(NamedTuple):
    """A quantity, and its derivatives.

    Attributes:
        value: (poses,) m or rad.
        by_node: (poses, 6) by the node's twist at its origin in the world's axes.
        by_device: (poses, 6) by the device's components.
        by_target: (poses, 6) by the target's.
    """

    value: Array
    by_node: Array
    by_device: Array
    by_target: Array


class MeasuringFrames:
    """Poses of devices and targets that are not known.

    Args:
        quantities: that were measured, some in the frame of a device or for a target.

    Attributes:
        names: of the parameters, such as `tracker.x` or `ball.rz`.
        dimensions: of these.
        devices: names of the devices.
        start: (4, 4) poses by name: of a device in the world, of a target on its node; the parameters are 0 there.

    Raises:
        DesignError: one name means two things.
    """

    def __init__(self, quantities: Sequence[MeasuredQuantity]) -> None:
        self.devices = tuple(dict.fromkeys(quantity.device for quantity in quantities if quantity.device))
        nodes: dict[str, str] = {}
        moved, turned = set(self.devices), set(self.devices)
        for quantity in (quantity for quantity in quantities if quantity.target):
            if nodes.setdefault(quantity.target, quantity.of) != quantity.of or quantity.target in self.devices:
                other = "a device" if quantity.target in self.devices else f"on {nodes[quantity.target]}"
                raise DesignError(
                    f"'{quantity.name}': the target '{quantity.target}' is {other}, too: give each its own name"
                )
            (turned if quantity.dimension is ANGLE else moved).add(quantity.target)
        self.start = {name: np.eye(4) for name in (*self.devices, *nodes)}
        components = [(frame, k) for frame in self.start for k in range(6) if frame in (moved if k < 3 else turned)]
        self.names = tuple(f"{frame}.{COORDINATES[k]}" for frame, k in components)
        self.dimensions: tuple[Dimension, ...] = tuple(LENGTH if k < 3 else ANGLE for _, k in components)
        self._at = {
            frame: [(i, k) for i, (of, k) in enumerate(components) if of == frame] for frame in self.start
        }  # parameters and components of each

    def __len__(self) -> int:
        return len(self.names)

    def pose(self, name: str, values: Array) -> Array:
        """Return the pose (4, 4) of a device or target at values (parameters,)."""
        step, placement = self._step(name, values), self.start[name].copy()
        placement[:3, :3] = pin.exp3(step[3:]) @ placement[:3, :3]
        placement[:3, 3] += step[:3]
        return placement

    def observe(self, quantity: MeasuredQuantity, placement: Array, values: Array) -> Seen:
        """Return what a device reads of a node at poses (poses, 4, 4), at values (parameters,)."""
        device = self.pose(quantity.device, values) if quantity.device else np.eye(4)
        target = self.pose(quantity.target, values) if quantity.target else np.eye(4)
        target_placement = placement @ target
        turn = device[:3, :3]
        seen = np.zeros_like(target_placement)
        seen[:, :3, :3], seen[:, 3, 3] = turn.T @ target_placement[:, :3, :3], 1.0
        seen[:, :3, 3] = (target_placement[:, :3, 3] - device[:3, 3]) @ turn
        value, row = read(quantity, seen)
        a, b = row[:, :3] @ turn.T, row[:, 3:] @ turn.T
        arm, back = target_placement[:, :3, 3] - placement[:, :3, 3], np.swapaxes(placement[:, :3, :3], 1, 2)
        by_device = -np.hstack([a, b + np.cross(target_placement[:, :3, 3] - device[:3, 3], a)])
        by_target = np.hstack([np.einsum("nij,nj->ni", back, a), np.einsum("nij,nj->ni", back, b)])
        for name, derivative in ((quantity.device, by_device), (quantity.target, by_target)):
            if name:
                derivative[:, 3:] = derivative[:, 3:] @ pin.Jexp3(-self._step(name, values)[3:])
        return Seen(value, np.hstack([a, b + np.cross(arm, a)]), by_device, by_target)

    def columns(self, quantity: MeasuredQuantity, seen: Seen) -> Array:
        """Return the derivative (poses, parameters) of a quantity."""
        derivatives = np.zeros((len(seen.value), len(self)))
        for name, rows in ((quantity.device, seen.by_device), (quantity.target, seen.by_target)):
            for i, k in self._at.get(name, ()):
                derivatives[:, i] = rows[:, k]
        return derivatives

    def locate(
        self, quantities: Sequence[MeasuredQuantity], measured: Array, nodes: dict[str, Array], length: float,
        source: str, rough: bool = False,
    ) -> None:  # fmt: skip
        """Set `start`, by the readings and the robot as it is described.

        First the devices, by the positions that they have read (`_place`). Then the rotation of each target P on its
        node X, by the angles that a device D has read: D^-1 X P is measured, so R_P is the mean of R_X^T R_D R_measured
        over the poses. Then all frames together, by all readings (`_refine`).

        Args:
            quantities: of the columns.
            measured: (poses, columns) readings, m and rad; NaN where nothing was measured.
            nodes: poses (poses, 4, 4) of the nodes, by name.
            length: the characteristic length, m.
            source: name of the measurements, for messages.
            rough: whether the positions that devices have read place these well enough.

        Raises:
            DesignError: the positions that a device has read are in another unit.
        """
        column = {
            (quantity.device, quantity.of, quantity.target, quantity.point, quantity.kind): k
            for k, quantity in enumerate(quantities)
        }

        def triples(device: str, kinds: Sequence[str]) -> list[tuple[MeasuredQuantity, Array]]:
            """Return what a device has read in three columns of these kinds: the first, and (poses, 3) readings."""
            readings = []
            for quantity in (q for q in quantities if q.device == device and q.kind == kinds[0]):
                keys = [(device, quantity.of, quantity.target, quantity.point, kind) for kind in kinds]
                if all(key in column for key in keys):
                    readings.append((quantity, measured[:, [column[key] for key in keys]]))
            return readings

        positions = {device: triples(device, COORDINATES[:3]) for device in self.devices}
        for device, readings in positions.items():
            self._place(device, readings, nodes, source)
        if rough and all(positions.get(name) for name in self.start):
            return
        for device in ("", *self.devices):
            of_device = self.start.get(device, np.eye(4))[:3, :3]
            for quantity, angles in triples(device, COORDINATES[3:]):
                is_read = np.isfinite(angles).all(axis=1)
                if quantity.target and is_read.any():
                    as_read = np.array([pin.rpy.rpyToMatrix(*row) for row in angles[is_read]])
                    to_node = np.swapaxes(nodes[quantity.of][is_read, :3, :3], 1, 2)
                    self.start[quantity.target][:3, :3] = _rotation((to_node @ of_device @ as_read).mean(axis=0))
        self._refine(quantities, measured, nodes, length)
        self._warn_of_targets(quantities, nodes, source)

    def _place(
        self, device: str, positions: Sequence[tuple[MeasuredQuantity, Array]], nodes: dict[str, Array], source: str
    ) -> None:
        """Place a device by the positions that it has read, targets at the origins of their nodes (Kabsch's algorithm,
        without those that are far off)."""
        wanted, seen = list[Array](), list[Array]()
        for quantity, measured in positions:
            whole = np.isfinite(measured).all(axis=1)
            placed = nodes[quantity.of][whole]
            seen.append(measured[whole])
            wanted.append(placed[:, :3, 3] + placed[:, :3, :3] @ np.array(quantity.point))
        if sum(map(len, seen)) < _FEWEST:
            return
        m, x = np.concatenate(seen), np.concatenate(wanted)
        extents = [float(np.median(np.linalg.norm(y - np.median(y, axis=0), axis=1))) for y in (x, m)]
        for wrong, right, factor in UNITS[LENGTH]:
            if abs(extents[0] / max(factor * extents[1], 1e-300) - 1.0) < _SCALED:
                raise DesignError(
                    f"{source}: the positions that {device} has read would fit if they were {factor:.4g} times as "
                    f"large: are they in {right}, and read as {wrong}?"
                )
        near = np.ones(len(m), dtype=bool)
        for _ in range(_ROUNDS):
            centres = x[near].mean(axis=0), m[near].mean(axis=0)
            turn = _rotation((x[near] - centres[0]).T @ (m[near] - centres[1]))
            place = centres[0] - turn @ centres[1]
            off = np.linalg.norm(m @ turn.T + place - x, axis=1)
            near = off <= _NEAR * np.median(off)
        self.start[device][:3, :3], self.start[device][:3, 3] = turn, place

    def _refine(
        self, quantities: Sequence[MeasuredQuantity], measured: Array, nodes: dict[str, Array], length: float
    ) -> None:
        """Fit all frames to all of their readings, with a loss that outliers hardly change."""
        chosen = [k for k, quantity in enumerate(quantities) if quantity.device or quantity.target]
        sizes = np.array([_EXPECTED * (length if quantities[k].dimension is LENGTH else 1.0) for k in chosen])
        present = np.isfinite(measured[:, chosen]).T

        def residuals(values: Array) -> Array:
            off = np.array([self.observe(quantities[k], nodes[quantities[k].of], values).value for k in chosen])
            off -= measured[:, chosen].T
            for row, k in zip(off, chosen, strict=True):
                if quantities[k].dimension is ANGLE:
                    row[:] = (row + np.pi) % (2.0 * np.pi) - np.pi
            return np.asarray((off / sizes[:, None])[present])

        def jacobian(values: Array) -> Array:
            rows = [
                self.columns(quantities[k], self.observe(quantities[k], nodes[quantities[k].of], values))
                for k in chosen
            ]
            return np.asarray((np.array(rows) / sizes[:, None, None])[present])

        done = least_squares(residuals, np.zeros(len(self)), jacobian, loss="soft_l1", x_scale="jac", max_nfev=100)
        self.start = {name: self.pose(name, done.x) for name in self.start}

    def _warn_of_targets(self, quantities: Sequence[MeasuredQuantity], nodes: dict[str, Array], source: str) -> None:
        """Warn of targets whose offset along some direction only errors of the robot distinguish from the position of
        their device: those are small, but act on the whole offset."""
        pairs = {
            (quantity.target, quantity.of): quantity for quantity in quantities if quantity.target and quantity.device
        }
        for (target, node), quantity in pairs.items():
            turns = nodes[node][:, :3, :3]
            spread = np.linalg.svd((turns - turns.mean(axis=0)).reshape(-1, 3), compute_uv=False) / len(turns) ** 0.5
            if f"{target}.x" in self.names and spread[-1] < _TURNED:
                warn(
                    f"{source}: {node} hardly rotates{' but about one axis' if spread[0] >= _TURNED else ''} in these "
                    f"poses: where '{target}' is on it can't be told from where {quantity.device} is; measure it, and "
                    f"write its position to a millimetre or so in place of its name: {node}(10mm 0 50mm)"
                )

    def twists(self, device: str) -> Array:
        """Return the twists (6, parameters) of a device at its start, of the point at the world's origin."""
        twists, origin = np.zeros((6, len(self))), self.start[device][:3, 3]
        for i, k in self._at[device]:
            twists[k, i] = 1.0
            twists[:3, i] += np.cross(origin, twists[3:, i])
        return twists

    def _step(self, name: str, values: Array) -> Array:
        step = np.zeros(6)
        for i, k in self._at[name]:
            step[k] = values[i]
        return step


def _rotation(matrix: Array) -> Array:
    """Return the rotation nearest to a matrix (3, 3)."""
    u, _, vt = np.linalg.svd(matrix)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)
