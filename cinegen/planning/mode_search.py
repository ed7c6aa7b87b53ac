"""Paths between closed configurations, and their singular values: two trees that grow towards each other."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

from cinegen.arrays import Array
from cinegen.collision.clearance import clearance_of
from cinegen.collision.mesh_check import MeshCheck
from cinegen.collision.scene import Scene
from cinegen.errors import ClosureError
from cinegen.ik.local_ik import LocalIK
from cinegen.planning.clear_motion import clear_motion
from cinegen.singularities.crossing import crossings, of_passive_joints

_LONGEST = 0.8  # rad or characteristic lengths: to a new configuration
_DISTINCT = 1e-3  # rad or characteristic lengths: nearer configurations are one assembly mode
_SAME = 1e-6  # rad or characteristic lengths: nearer configurations are the same
DEPTH = 12  # times that a segment is halved to bound its singular value


@dataclass(frozen=True, eq=False, repr=False)
class CrossedSingularity:
    """A singularity of type 2 on a path.

    Attributes:
        segment: index of the configuration of the path before it.
        q: (nq,) configuration, loops closed.
        sigma: smallest singular value of the passive joints there, dimensionless; 0 up to how well it was located.
    """

    segment: int
    q: Array
    sigma: float

    def __repr__(self) -> str:
        return f"<CrossedSingularity after configuration {self.segment}: sigma {self.sigma:.2g}>"


class _Tree:
    """Configurations (nq,), each with a motion to it from another one.

    Attributes:
        nodes: the configurations; the roots first.
        parents: of each one the index of the one before it; -1 of a root.
    """

    def __init__(self, roots: Sequence[Array]) -> None:
        self.nodes, self.parents = list(roots), [-1] * len(roots)

    def add(self, parent: int, q: Array) -> int:
        """Add a configuration; return its index."""
        self.nodes.append(q)
        self.parents.append(parent)
        return len(self.nodes) - 1

    def branch(self, index: int) -> list[Array]:
        """Return the configurations from one of the tree back to its root."""
        branch = []
        while index >= 0:
            branch.append(self.nodes[index])
            index = self.parents[index]
        return branch


class ModeSearch:
    """Paths between closed configurations of a scene, and their singular values.

    Two trees grow towards each other (J. J. Kuffner and S. M. LaValle, "RRT-Connect", ICRA 2000) on the closed
    configurations (D. Berenson, S. Srinivasa, D. Ferguson, J. J. Kuffner, "Manipulation planning on constraint
    manifolds", ICRA 2009). Joints without limits count modulo a revolution, unlike in a box of OMPL, where the trees
    would meet only if their legs have made the same revolutions.
    """

    def __init__(self, scene: Scene, locked: tuple[str, ...], margin: float, seed: int) -> None:
        self.clearance, self.check = clearance_of(scene), MeshCheck(scene)
        self._scene, self._mechanism, self._margin = scene, scene.mechanism, margin
        self._rows, self._rng = of_passive_joints(scene.mechanism), np.random.default_rng(seed)
        self._samples, mechanism = LocalIK(scene.mechanism), scene.mechanism
        self._locked, self._fixed = locked, [mechanism.v_index(name) for name in locked]
        self._revolving = np.zeros(mechanism.model.nv, dtype=bool)
        for name in mechanism.joints:
            if not mechanism.is_prismatic(name) and np.isinf(mechanism.limits[name][:2]).all():
                self._revolving[mechanism.v_index(name)] = True

    def sigma(self, q: Array) -> float:
        """Return the smallest singular value of the passive joints at q (nq,), dimensionless."""
        return float(self._rows.sigma(self._rows.of(q)[None])[0])

    def is_free(self, q: Array) -> bool:
        """Return whether q (nq,) keeps the safety distance."""
        return self.clearance.least(q) >= self._scene.safety

    def is_goal(self, q: Array) -> bool:
        """Return whether q (nq,) is another configuration than the start, with the same values of locked joints, within
        limits and free of collisions."""
        away = self.between(self._scene.start, q)
        if np.linalg.norm(away) <= _DISTINCT or np.abs(away[self._fixed]).max(initial=0.0) > _SAME:
            return False
        return bool(self._mechanism.limits.within(q)) and self.is_free(q) and not self.check.contact(q)

    def between(self, begin: Array, end: Array) -> Array:
        """Return the shortest difference (nv,) of two configurations, rad and characteristic lengths."""
        step = self._mechanism.scaled_difference(begin, end)
        step[self._revolving] = np.remainder(step[self._revolving] + np.pi, 2.0 * np.pi) - np.pi
        return step

    def apart(self, q: Array, other: Array) -> float:
        """Return the distance of two configurations, rad and characteristic lengths."""
        return float(np.linalg.norm(self.between(q, other)))

    def _moved(self, q: Array, step: Array) -> Array:
        """Return the configuration (nq,) a step (nv,) from q, rad and characteristic lengths."""
        return self._mechanism.integrate(q, step * self._mechanism.scale)

    # --- paths ---------------------------------------------------------------------------------------------------

    def path(self, goals: Sequence[Array], through: bool, seconds: float) -> Array | None:
        """Return a path (n, nq) from the start to one of the goals (nq,), loops closed; None if the time was too short.

        Args:
            goals: configurations.
            through: whether it may pass singularities of type 2.
            seconds: time limit, s.
        """
        deadline = time.monotonic() + seconds
        tree, other = trees = _Tree([self._scene.start]), _Tree(goals)
        while time.monotonic() < deadline:
            new = self._extended(tree, self._samples.random_start(self._rng), through)
            met = None if new is None else self._connected(other, tree.nodes[new], through, deadline)
            if new is not None and met is not None:
                first, last = (new, met) if tree is trees[0] else (met, new)
                path = self._shortened([*trees[0].branch(first)[::-1], *trees[1].branch(last)[1:]], through)
                if path is not None:
                    return path
            tree, other = other, tree
        return None

    def _shortened(self, waypoints: Sequence[Array], through: bool) -> Array | None:
        """Return the motion (n, nq) along configurations, past as many as possible; None if one is not allowed."""
        path, reached = waypoints[0][None], 0
        while reached < len(waypoints) - 1:
            for target in range(len(waypoints) - 1, reached, -1):
                motion = self.motion(path[-1], waypoints[target], through)
                if motion is not None:
                    path, reached = np.vstack([path, motion[1:]]), target
                    break
            else:
                return None
        return path

    def motion(self, begin: Array, end: Array, through: bool) -> Array | None:
        """Return a motion (n, nq) between two configurations; None if it is not allowed."""
        end = self._moved(begin, self.between(begin, end))
        motion = clear_motion(self.clearance, begin, end, self._scene.safety, self._locked if through else None)
        return motion if motion is None or through or self._is_regular(motion) else None

    def _is_regular(self, path: Array) -> bool:
        """Return whether the singular value exceeds the margin at the configurations of a path, and 0 in between."""
        matrices = np.array([self._rows.of(q) for q in path])
        sigma = self._rows.sigma(matrices)
        if sigma.min() < self._margin:
            return False
        bounds = (sigma[:-1] + sigma[1:]) / 2.0 - np.linalg.norm(np.diff(matrices, axis=0), axis=(1, 2))
        return all(self.bound(path[k], path[k + 1], 0.0, DEPTH) > 0.0 for k in np.flatnonzero(bounds <= 0.0))

    def _extended(self, tree: _Tree, target: Array, through: bool) -> int | None:
        """Add a configuration to a tree, nearer to a target than the nearest one is; return its index."""
        near = int(np.argmin([self.apart(q, target) for q in tree.nodes]))
        step = self.between(tree.nodes[near], target)
        step[self._fixed] = 0.0
        part = min(1.0, _LONGEST / max(float(np.linalg.norm(step)), _DISTINCT))
        try:
            q = self._mechanism.close(self._moved(tree.nodes[near], part * step), locked=self._locked)
        except ClosureError:
            return None
        return None if self.motion(tree.nodes[near], q, through) is None else tree.add(near, q)

    def _connected(self, tree: _Tree, target: Array, through: bool, deadline: float) -> int | None:
        """Extend a tree to a configuration, as far as it goes; return its index there."""
        left = np.inf
        while time.monotonic() < deadline:
            new = self._extended(tree, target, through)
            if new is None or (now := self.apart(tree.nodes[new], target)) >= left:
                return None
            if now < _SAME:
                return new
            left = now
        return None

    # --- singularities -------------------------------------------------------------------------------------------

    def bound(self, begin: Array, end: Array, enough: float, depth: int) -> float:
        """Return an estimated lower bound of the smallest singular value between two configurations of a path, see
        `ModeChange.sigma_bound`.

        Args:
            begin: (nq,)
            end: (nq,)
            enough: a bound that is large enough; a smaller one is improved by halving the segment.
            depth: how often.
        """
        a, b = self._rows.of(begin), self._rows.of(end)
        bound = float(self._rows.sigma(np.array([a, b])).mean() - np.linalg.norm(b - a))
        if bound >= enough or not depth:
            return bound
        middle = self._on_segment(begin, end, 0.5)
        return min(self.bound(begin, middle, enough, depth - 1), self.bound(middle, end, enough, depth - 1))

    def crossed(self, path: Array) -> tuple[CrossedSingularity, ...]:
        """Return the singularities of type 2 on a path (n, nq)."""
        return tuple(
            CrossedSingularity(k, crossing.q, self.sigma(crossing.q))
            for k, (begin, end) in enumerate(pairwise(path))
            for crossing in crossings(self._rows, partial(self._on_segment, begin, end))
        )

    def _on_segment(self, begin: Array, end: Array, part: float) -> Array:
        """Return the closed configuration (nq,) nearest to a part of the straight segment between two others."""
        if part in (0.0, 1.0):
            return end if part else begin
        return self._mechanism.close(self._mechanism.interpolate(begin, end, part), locked=self._locked)
