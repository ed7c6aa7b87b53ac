"""`Reach`: where a node must get to: a box, a ball, single points or poses."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array

AXES = ("x", "y", "z")

_SPHERES = 3


@dataclass(frozen=True, eq=False)
class Reach:
    """The targets of a node.

    A target is a row of coordinates of the world, m, followed by a rotation vector (rad, in the world's axes) where
    orientations are wanted: from the node's orientation at home, or, as `poses` states it, from the world's axes.

    Attributes:
        axes: coordinates of the world that are given, a part of x, y and z.
        low: (axes,) lower ends of the box around all targets, m.
        high: (axes,) upper ends, m; equal to the lower where a coordinate has one value.
        given: (n, columns) single targets instead of a region; empty otherwise.
        radius: of a ball within the axes about the middle of `low` and `high`, m, instead of a box; 0 otherwise.
        is_oriented: whether the node's orientation is wanted, too: that at home, unless the targets state others.
        is_absolute: whether rotation vectors begin at the world's axes.
    """

    axes: tuple[str, ...]
    low: Array
    high: Array
    given: Array = field(default_factory=lambda: np.zeros((0, 0)))
    radius: float = 0.0
    is_oriented: bool = False
    is_absolute: bool = False

    def relative_to(self, home: Array) -> Reach:
        """Return the same with rotation vectors that begin at the node's orientation at home (3, 3)."""
        if not self.is_absolute:
            return self
        turns = [pin.log3(pin.exp3(target[-3:]) @ home.T) for target in self.given]
        return replace(self, given=np.hstack([self.given[:, :-3], turns]), is_absolute=False)

    @property
    def rows(self) -> list[int]:
        """Components of the node's twist in the world that a target fixes."""
        return [AXES.index(axis) for axis in self.axes] + [3, 4, 5] * self.is_oriented

    @property
    def centre(self) -> Array:
        """(columns,) the middle of the region, from which it grows."""
        return np.asarray(self._oriented((self.low + self.high)[None] / 2.0)[0])

    @property
    def middle(self) -> Array:
        """(columns,) the target in the middle: the centre, or the single target that is nearest to it."""
        if not len(self.given):
            return self.centre
        apart = np.linalg.norm(self.given - self.given.mean(axis=0), axis=1)
        return np.asarray(self.given[np.argmin(apart)])

    @property
    def varying(self) -> int:
        """Number of axes along which the region is wide."""
        return int((self.high > self.low).sum())

    def grid(self, count: int) -> Array:
        """Return targets (n, columns): a regular grid with `count` points along each axis of the box; of a ball its
        centre, and directions evenly on concentric spheres; or the single targets."""
        if len(self.given):
            return self.given
        if self.radius:
            radii = np.linspace(0.0, 1.0, 1 + min((count - 1) // 2, _SPHERES))[1:]
            around = [radius * self._directions(count, radius) for radius in radii]
            return self._in_ball(np.vstack([np.zeros((1, len(self.axes))), *around]))
        lines = [
            np.linspace(low, high, count if high > low else 1) for low, high in zip(self.low, self.high, strict=True)
        ]
        return self._oriented(np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, len(self.axes)))

    def samples(self, count: int, seed: int) -> Array:
        """Return targets (count, columns) of a Sobol sequence, half of them on the boundary of the region; or the
        single targets.

        Points u of the cube |u|_max <= 1 become those of a ball along rays, u |u|_max / |u|_2, faces those of its
        surface.

        Args:
            count: number of targets of a region.
            seed: of the sequence's scrambling.
        """
        from scipy.stats import qmc

        if len(self.given):
            return self.given
        cube = 2.0 * qmc.Sobol(len(self.axes), seed=seed).random(count) - 1.0
        on_faces = cube[: count // 2]
        on_faces /= np.abs(on_faces).max(axis=1, keepdims=True)  # changes these rows of `cube`
        if not self.radius:
            return self._oriented((self.low + self.high) / 2.0 + cube * (self.high - self.low) / 2.0)
        size = np.linalg.norm(cube, axis=1, keepdims=True)
        return self._in_ball(cube * np.abs(cube).max(axis=1, keepdims=True) / np.where(size > 0.0, size, 1.0))

    def scaled(self, targets: Array, scale: float) -> Array:
        """Return targets of a region that has grown about its centre."""
        return np.asarray(self.centre + scale * (targets - self.centre))

    def _oriented(self, points: Array) -> Array:
        return np.pad(points, ((0, 0), (0, 3 * self.is_oriented)))

    def _in_ball(self, unit: Array) -> Array:
        return self._oriented((self.low + self.high) / 2.0 + self.radius * unit)

    def _directions(self, count: int, radius: float) -> Array:
        """Return unit vectors (n, axes), evenly spread: more on larger spheres."""
        n = max(4, round(4 * (count - 1) * radius ** (len(self.axes) - 1)))
        if len(self.axes) == 1:
            return np.array([[-1.0], [1.0]])
        if len(self.axes) == 2:
            angles = 2.0 * np.pi * np.arange(n) / n
            return np.stack([np.cos(angles), np.sin(angles)], axis=1)
        z = 1.0 - 2.0 * (np.arange(2 * n) + 0.5) / (2 * n)  # a Fibonacci lattice on the sphere
        turns = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(2 * n)
        across = np.sqrt(1.0 - z**2)
        return np.stack([across * np.cos(turns), across * np.sin(turns), z], axis=1)
