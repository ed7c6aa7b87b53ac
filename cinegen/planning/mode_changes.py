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
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

from cinegen.arrays import Array, ArrayLike
from cinegen.assembly.modes import assembly_modes
from cinegen.assembly.results import AssemblyModes
from cinegen.collision.errors import PlanningError
from cinegen.collision.scene import Scene
from cinegen.planning.attempt import Attempt, PlanStatus, checked
from cinegen.planning.mode_search import DEPTH, CrossedSingularity, ModeSearch
from cinegen.planning.planner import Plan
from cinegen.tolerances import NEAR_SINGULAR

_AROUND = "RRT-Connect, around singularities"
_THROUGH = "RRT-Connect, through singularities"
_TIGHT = 0.8  # of the smallest singular value at configurations: a bound that is large enough


class SingularPaths(Enum):
    """Treatment of singularities of type 2 on a path."""

    AVOID = "avoid"
    CROSS = "cross"


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
    search = ModeSearch(scene, (*scene.locked, *locked), margin, seed)
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
    bounds = [0.0] if crossed else [search.bound(a, b, _TIGHT * sigma, DEPTH) for a, b in pairwise(plan.path)]
    return ModeChange(plan, modes, reached, sigma, min([sigma, *bounds]), crossed)


def _plan(
    scene: Scene,
    search: ModeSearch,
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
