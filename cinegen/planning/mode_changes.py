"""`change_mode`: a path of a closed mechanism to another assembly mode, around its singularities or through one.

The configurations of a closed mechanism are divided by its singularities of type 2. Two assembly modes of the same
values of the actuated joints may lie on one side: then a path leads from one to the other without a singularity, around
a cusp of the singular curves in joint space (C. Innocenti and V. Parenti-Castelli, "Singularity-free evolution from one
configuration to another in serial and fully-parallel manipulators", 1998; P. R. McAree and R. W. Daniel, "An
explanation of never-special assembly changing motions for 3-3 parallel manipulators", 1999). Else only a path through a
singularity is left, where the actuated joints lose control: there a real mechanism is moved on by its momentum or by
gravity alone.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial
from itertools import pairwise

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.assembly.modes import assembly_modes
from cinegen.assembly.results import AssemblyModes
from cinegen.collision.clearance import clearance_of
from cinegen.collision.errors import PlanningError
from cinegen.collision.mesh_check import MeshCheck
from cinegen.collision.scene import Scene
from cinegen.errors import ClosureError
from cinegen.ik.local_ik import LocalIK
from cinegen.planning.attempt import Attempt, PlanStatus, checked
from cinegen.planning.clear_motion import clear_motion
from cinegen.planning.planner import Plan
from cinegen.singularities.crossing import crossings, of_passive_joints
from cinegen.tolerances import NEAR_SINGULAR

_AROUND = "RRT-Connect, around singularities"
_THROUGH = "RRT-Connect, through singularities"
_LONGEST = 0.8  # rad or characteristic lengths: to a new configuration
_DISTINCT = 1e-3  # rad or characteristic lengths: nearer configurations are one assembly mode
_SAME = 1e-6  # rad or characteristic lengths: nearer configurations are the same
_DEPTH = 12  # times that a segment is halved to bound its singular value
_TIGHT = 0.8  # of the smallest singular value at configurations: a bound that is large enough


class SingularPaths(Enum):
    """Treatment of singularities of type 2 on a path."""

    AVOID = "avoid"
    CROSS = "cross"


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


@dataclass(frozen=True, eq=False, repr=False)
class ModeChange:
    """Path to another assembly mode, or the reason why none was found.

    Attributes:
        plan: status and path; a mode change is true if it is REACHED. TIME_LIMIT is no proof that there is no path.
        modes: assembly modes for the values of the actuated joints at the goal.
        mode: index in `modes` of the one that is reached; None without a path.
        sigma: smallest singular value of the passive joints at the configurations of the path, dimensionless.
        sigma_bound: estimated lower bound of it anywhere on the path, 0 on a path through a singularity. By Weyl's
            inequality, from the change of the matrix between configurations, counted twice because its path between
            them is curved; that twice is enough is not proved.
        crossed: singularities of type 2 on the path; empty if it keeps clear of them.
    """

    plan: Plan
    modes: AssemblyModes
    mode: int | None
    sigma: float
    sigma_bound: float
    crossed: tuple[CrossedSingularity, ...]

    def __bool__(self) -> bool:
        return bool(self.plan)

    def __str__(self) -> str:
        if self.mode is None:
            return str(self.plan)
        count = len(self.crossed)
        how = "without a singularity"
        if count:
            how = "through a singularity" if count == 1 else f"through {count} singularities"
        return f"{self.plan}: assembly mode {self.mode + 1} of {len(self.modes)}, {how} of type 2"

    def __repr__(self) -> str:
        return f"<ModeChange {self}>"


def change_mode(
    scene: Scene,
    actuated: ArrayLike | None = None,
    *,
    mode: int | None = None,
    locked: Iterable[str] = (),
    singular: SingularPaths | str = SingularPaths.AVOID,
    margin: float = NEAR_SINGULAR,
    seconds: float = 30.0,
    seed: int = 0,
    report: Callable[[str], None] = lambda text: None,
) -> ModeChange:
    """Plan a path to another assembly mode among a scene's obstacles: RRT-Connect on the closed configurations.

    The goal is another assembly mode with the given values of the actuated joints; a scene's goal that is a pose is not
    considered. The smallest singular value of the passive joints stays above a margin. Each motion is one of
    `clear_motion`: actuated joints move straight, and the safety distance is kept everywhere.

    If singularities may be crossed, and the first half of the time finds no path around them, motions follow the closed
    configurations themselves: at a singularity of type 2 the actuated joints then reverse.

    Args:
        scene: robot with loops, its start and obstacles.
        actuated: (actuated,) values in `mechanism.actuated` order, rad and m; by default those of the scene's goal, if
            that is one of joint values, else those of the start.
        mode: index of the assembly mode to reach, in the order of `assembly_modes`; any other one by default.
        locked: names of joints that keep their values of the start, besides those of the scene.
        singular: one of `SingularPaths` or its value.
        margin: smallest singular value that is kept where singularities are avoided, dimensionless.
        seconds: time limit, s, of the search for a path, after that for assembly modes.
        seed: seed of random samples, from 0.
        report: called with a text about what is done.

    Returns:
        the change; OUT_OF_REACH if there is no other assembly mode within limits and free of collisions.

    Raises:
        ModesError: the actuated joints don't determine the mechanism, or there are no loops.
        PlanningError: an argument is invalid, the scene has constraints along the path or weights of joints, or the
            start is nearer to a singularity than the margin.
    """
    singular = _checked(singular, margin, seconds, seed)
    if scene.path_constraints:
        raise PlanningError("a change of assembly mode keeps no constraints along the path: remove them (path)")
    if scene.has_weights:
        raise PlanningError("a change of assembly mode obeys no weights of joints: remove them (weights)")
    mechanism = scene.mechanism
    end = scene.start if scene.goal_configuration is None else scene.goal_configuration
    values = [end[mechanism.q_index(name)] for name in mechanism.actuated] if actuated is None else actuated
    report("computing the assembly modes")
    modes = assembly_modes(mechanism, values)
    search = _Search(scene, (*scene.locked, *locked), margin, seed)
    if singular is SingularPaths.AVOID and (sigma := search.sigma(scene.start)) < margin:
        raise PlanningError(f"the start is singular up to sigma {sigma:.2g}, below the margin of {margin:g}")
    if mode is not None and not 0 <= mode < len(modes):
        raise PlanningError(f"there is no assembly mode {mode + 1}: there are {len(modes)}")
    goals = {k: q for k, q in enumerate(modes) if (mode is None or k == mode) and search.is_goal(q)}
    methods = ((_AROUND, False), (_THROUGH, True)) if singular is SingularPaths.CROSS else ((_AROUND, False),)
    what = "another assembly mode" if mode is None else f"assembly mode {mode + 1}, if it is another one,"
    missing = f"{what} is not within limits and free of collisions; there are {len(modes)}"
    plan = _plan(scene, search, list(goals.values()), missing, methods, seconds / len(methods), report)
    reached = min(goals, key=lambda k: search.apart(plan.path[-1], goals[k])) if plan else None
    sigma, crossed = min(search.sigma(q) for q in plan.path), search.crossed(plan.path)
    bounds = [0.0] if crossed else [search.bound(a, b, _TIGHT * sigma, _DEPTH) for a, b in pairwise(plan.path)]
    return ModeChange(plan, modes, reached, sigma, min([sigma, *bounds]), crossed)


def _plan(
    scene: Scene,
    search: _Search,
    goals: Sequence[Array],
    missing: str,
    methods: Sequence[tuple[str, bool]],
    seconds: float,
    report: Callable[[str], None],
) -> Plan:
    """Return the plan to one of the goals.

    Args:
        scene: see `change_mode`.
        search: its paths.
        goals: (nq,) each.
        missing: the reason if there are none.
        methods: names of what is tried, and whether it may pass singularities of type 2.
        seconds: time limit of each method, s.
        report: see `change_mode`.
    """
    start, made = scene.start[None].copy(), list[Attempt]()
    status, path, reason = PlanStatus.OUT_OF_REACH, start, missing
    if not search.is_free(scene.start):
        status = PlanStatus.START_IN_COLLISION
        reason = f"the start is nearer to something than the safety distance of {scene.safety:g} m"
        methods = ()
    for strategy, crossing in methods if goals else ():
        report(f"{strategy}, {seconds:.3g} s at most")
        motion = search.path(goals, crossing, seconds)
        if motion is None:
            reason = f"no path was found in {seconds:.3g} s, which is no proof that there is none"
            made.append(Attempt(strategy, PlanStatus.TIME_LIMIT, start, (), reason))
        else:
            made.append(checked(Attempt(strategy, PlanStatus.REACHED, motion, (), ""), search.check))
        status, path, reason = made[-1].status, made[-1].path, made[-1].reason
        if status is PlanStatus.REACHED:
            break
    return Plan(scene, status, path, tuple(made), reason, search.clearance, search.check, None)


def _checked(singular: SingularPaths | str, margin: float, seconds: float, seed: int) -> SingularPaths:
    """Return what singular paths are allowed.

    Raises:
        PlanningError: an argument is invalid.
    """
    try:
        paths = SingularPaths(singular)
    except ValueError:
        known = ", ".join(repr(allowed.value) for allowed in SingularPaths)
        raise PlanningError(f"singular must be one of {known}, not {singular!r}") from None
    if not (math.isfinite(margin) and margin > 0.0):
        raise PlanningError(f"margin must be above 0, not {margin}")
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise PlanningError(f"seconds must be above 0, not {seconds}")
    if seed < 0:
        raise PlanningError(f"seed must be 0 or above, not {seed}")
    return paths


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


class _Search:
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
        return all(self.bound(path[k], path[k + 1], 0.0, _DEPTH) > 0.0 for k in np.flatnonzero(bounds <= 0.0))

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
