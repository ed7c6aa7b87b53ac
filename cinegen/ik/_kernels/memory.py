"""Memory of the kernels that solve tasks; see `cinegen.loops._kernels.memory`."""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, Table
from cinegen.jit.memory import Memory, array, foreign, parameter, state, view
from cinegen.loops._kernels.memory import LoopMemory
from cinegen.loops.thresholds import NEAR_SINGULAR

OF_TARGET, OF_WORLD, OF_NODE = range(3)
"""Frame whose axes a task's rows are expressed in."""


class TaskMemory(Memory):
    """One task: a frame on a node follows a pose or a twist, or Python gives its error and rows."""

    n: int = parameter(0)
    is_valid: int = parameter(1)
    place: int = parameter(0)  # among all tasks, in the order in which they were added
    level: int = parameter(0)  # 0 is served first
    python_rows: int = parameter(0)  # rows that Python gives, or 0
    joint: int = parameter(0)  # joint that carries the node
    translation: int = parameter(3)  # rows of translations: they come first
    rotation: int = parameter(3)  # rows of rotations; if 2, they are those of a swing
    weight: float = parameter(1.0)  # of its heaviest row
    is_even: int = parameter(1)  # all rotations have the same weight
    row_axis: Table = array(6, dtype=int)  # of each row: translation along 0 to 2, rotation about 3 to 5
    row_weight: Array = array("weighed")  # of each row, as a part of `weight`
    weighed: int = parameter(6)
    axes_of: int = parameter(OF_TARGET)
    axes_joint: int = parameter(0)  # joint that carries the node whose axes are used
    is_twist: int = parameter(0)
    target: int = parameter(0)  # address of a frame (4, 3)
    own_target: Array = array(4, 3)  # used if the target's own memory can't be read
    offset: Array = array(4, 3)  # frame that follows, relative to the joint
    axes: Array = array(3, 3)  # of that node, relative to the joint
    twist: Array = array(6)
    moved_by: Array = array("n")  # 1 for DoF that move the node, else 0
    given_error: Array = array("python_rows")  # of the last evaluation, dimensionless: lengths come first
    given_rows: Array = array("python_rows", "n")  # at q; how the error shrinks by steps, dimensionless

    # in the present tick
    is_active: int = state(0)
    kept_error: Array = array("python_rows")  # at the end of the last tick
    aim: Array = array(4, 3)  # target of this tick
    world_axes: Array = array(3, 3)
    distance: float = state(0.0)  # remaining distance, m
    angle: float = state(0.0)  # rad
    linear: float = state(0.0)  # the same, rows weighted by `row_weight`; lengths
    angular: float = state(0.0)  # rad
    is_followed: int = state(0)  # a twist was followed in the last tick
    is_still: int = state(0)  # the target has not moved
    remaining: float = state(0.0)  # error at the end of the tick, dimensionless


task_at = view(TaskMemory)


class TasksMemory(LoopMemory):
    """A mechanism with tasks."""

    tasks: int = parameter(0)
    task_rows: int = parameter(0)  # of all tasks, valid or not
    task_handles: Table = array("tasks", dtype=int)
    dt: float = parameter(1.0)
    gain: float = parameter(1.0)  # fraction of an error that a tick corrects
    lower: Array = array("n")  # position limits, m and rad
    upper: Array = array("n")

    levels: int = parameter(1)
    level_end: Table = array("levels", dtype=int)  # of each level, one more than its last row in this tick
    heaviest: Array = array("levels")  # weight of its active tasks
    active_rows: int = state(0)  # of the first level's tasks that are valid in this tick
    signature: int = state(-1)  # bits of the tasks that were active when their rank was requested
    error: Array = array("task_rows")  # remaining errors
    wanted: Array = array("task_rows")  # to be corrected in this tick: capped and weighted
    row_weights: Array = array("task_rows")  # as fractions of the heaviest row's
    lightest: float = state(1.0)  # smallest of these, of the first level
    trial_error: Array = array("task_rows")
    task_jacobian: Array = array("task_rows", "n")  # weighted


class LocalIKMemory(TasksMemory):
    """A mechanism whose tasks and loops are solved as one system of equations."""

    equations: int = parameter(0)  # rows of tasks and loops
    goal_residual: float = parameter(0.0)
    most_iterations: int = parameter(0)
    iterations: int = state(0)
    stalled: float = state(0.0)  # iterations without progress
    cost: float = state(math.inf)  # squared residual of the best so far
    damping: float = state(0.0)
    tasks_left: float = state(0.0)  # largest residual of the tasks
    loops_left: float = state(0.0)
    system: Array = array("equations", "n")
    right_side: Array = array("equations")
    normal: Array = array("equations", "equations")
    solution: Array = array("equations")
    free: Array = array("n")  # 1 for joints that no limit restricts


class BatchMemory(LoopMemory):
    """A mechanism that is evaluated at many configurations, for one node."""

    mobility: int = parameter(0)
    wide: int = parameter(6)  # the larger of n and 6
    joint: int = parameter(0)  # that carries the node
    translation: int = parameter(3)  # translations that its singular values include, in its own axes
    rotation: int = parameter(3)
    passive: int = parameter(0)  # passive and cut joints' DoF if their smallest singular value is computed, else 0
    node_offset: Array = array(4, 3)  # the node, relative to the joint
    moved_by: Array = array("n")  # 1 for DoF that move it, else 0
    passive_column: Table = array("passive", dtype=int)  # of the screw matrix

    # input
    count: int = parameter(0)
    is_given: int = parameter(0)  # configurations are given, not values of the actuated joints
    is_whole: int = parameter(0)  # all results are computed, and not only the smallest singular value
    width: int = parameter(0)  # singular values
    whole: int = parameter(0)  # count if all results are computed, else 0
    configurations: Array = foreign("count", "nq")
    values: Array = foreign("count", "actuated")
    anchor: Array = array("nq")  # the last configuration that could be closed

    # results
    result_q: Array = foreign("count", "nq")
    placements: Array = foreign("whole", 4, 4)
    jacobians: Array = foreign("whole", 6, "actuated")
    singular_values: Array = foreign("count", "width")
    closures: Array = foreign("count")
    passive_sigma: Array = foreign("count")

    # scratch
    node: Array = array(4, 3)
    node_rows: Array = array(6, "n")
    free_rows: Array = array(6, "mobility")
    null_space: Array = array("mobility", "n")
    system: Array = array("mobility", "wide_system")
    wide_system: int = parameter(6)  # mobility + 6
    wide_rows: Array = array(6, "wide")
    tall_rows: Array = array("wide", 6)
    triangle: Array = array(6, 6)
    squares: Array = array(2, 6)
    passive_columns: Array = array("screw_rows", "passive")
    passive_work: Array = array(2, "passive")


SVD, BASIS, SVD_UNLOCKED = range(3)
"""Method of a step: singular values, an orthonormal basis of rows, singular values without locked joints."""

(
    STATUS, CLOSURE, SPEED_SCALE, TASK_RANK, LIMITING_DOF, EVALUATIONS, SWEEPS, ERRORS_KNOWN, SIGMA_KNOWN,
    FAILED_OBJECTIVES, ACTIVE_BARRIERS, REPORT_SIZE,
) = range(12)  # fmt: skip
"""The report of a tick."""
MOST_FLAGS = 52  # distinguishable objectives or barriers: bits of a double


class StepMemory(TasksMemory, part=True):
    """The step of a tick: dimensionless, without and with limits, attempted and made."""

    mobility: int = parameter(0)  # DoF that the loops leave
    parts: int = parameter(0)  # levels + 1 if there are several, else 0
    has_acceleration_limits: int = parameter(0)
    longest_step: Array = array("n")
    longest_change: Array = array("n")  # of the step, from tick to tick

    free_step: Array = array("mobility")
    step: Array = array("n")
    attempted: Array = array("n")
    moved: Array = array("n")  # motion that it led to
    last: Array = array("n")  # motion of the last tick
    drift: Array = array("n")  # its part that closed the loops
    braking: Array = array("n")  # step with the largest deceleration
    secondary: Array = array("n")  # accepted part of the null-space velocity

    # scratch
    fresh: Array = array("n")
    most_active: int = parameter(1)  # mobility + 1: one that may be added
    active_normals: Array = array(3, "most_active", "mobility")
    active: Array = array(4, "mobility")
    axis_order: Table = array("mobility", dtype=int)


class DirectionsMemory(StepMemory, part=True):
    """Directions of the first level's tasks in the motions that loops leave: singular vectors, or a basis of rows."""

    task_rank: int = parameter(0)  # generic, of the active tasks
    damping_threshold: float = parameter(NEAR_SINGULAR)
    lesser: int = parameter(0)  # of task_rows and mobility
    larger: int = parameter(0)
    ticks: int = state(0)
    found_by: int = state(SVD)
    is_warm: int = state(0)  # the last singular vectors are a start for the next
    sweeps: int = state(0)
    aims: int = state(0)  # refined tasks are corrected to what the step promises, not to their targets
    refined_rank: int = state(0)  # directions of the first level that are corrected
    coordinates: Array = array("mobility")  # scratch
    reduced: Array = array("lesser", "larger")  # the tasks' rows in the null space of the loops
    left: Array = array("lesser", "lesser")
    right: Array = array("lesser", "larger")
    squares: Array = array("lesser")
    emphasis: Array = array("lesser")  # squared weight of the tasks along each
    triangle: Array = array(2, "task_rows", "task_rows")
    axes: Array = array("mobility", "mobility")
    size: Array = array("mobility")


class AttemptMemory(StepMemory, part=True):
    """The attempt to make the step, and its judgement."""

    tries: int = state(0)  # number of times the step was shortened
    brakings: int = state(0)  # number of times that braking was scaled at the last try
    closes: int = state(0)  # loops could be closed after some fraction of the step
    is_refined: int = state(0)  # tasks are corrected together with the loops
    is_nudged: int = state(0)  # the step leads out of a singularity
    promised: float = state(0.0)  # predicted reduction
    lack: float = state(0.0)  # last remaining error of the refined tasks
    clear_part: float = state(1.0)  # fraction of the step to the trial that barriers allow


class BoundsMemory(StepMemory, part=True):
    """Bounds of the step, of joints and then of barriers."""

    barrier_capacity: int = parameter(0)
    bounds: int = parameter(0)  # n + barrier_capacity
    barriers: int = parameter(0)  # rows in this tick
    barrier_rows: Array = array("barrier_capacity", "n")
    barrier_room: Array = array("barrier_capacity")
    floor: Array = array("bounds")
    ceiling: Array = array("bounds")
    stopped: Array = array("bounds")  # -1 or 1 where the lower or upper one is active
    room: Array = array(3, "bounds")
    normals: Array = array("bounds", "mobility")
    wanted_point: Array = array("mobility")


class SecondaryMemory(DirectionsMemory, BoundsMemory, part=True):
    """The null-space velocity that objectives ask for."""

    has_secondary: int = state(0)  # there is a null-space velocity in this tick
    failed_objectives: int = state(0)  # bits
    secondary_wanted: Array = array("n")
    secondary_free: Array = array("mobility")
    secondary_scale: float = state(1.0)  # step scale of the null-space velocity


class LevelsMemory(SecondaryMemory, part=True):
    """Levels below the first, and after them the objectives."""

    level_rank: Table = array("levels", dtype=int)  # generic, of the freedom that the levels above leave
    level_scale: Array = array("parts")  # step scale
    level_still: Array = array("parts")  # 1 if no target of its tasks has moved
    level_part: Array = array("parts", "n")  # of the step: that of each level
    level_last: Array = array("parts", "n")  # of the last tick
    level_rest: Array = array("levels")  # predicted cost without its part of the step: levels above change it, too
    level_promised: Array = array("levels")  # predicted reduction of that by its part
    level_cost: Array = array("levels")  # cost of its tasks at the beginning of the tick
    level_sigma: Array = array("levels")  # smallest singular value
    level_limit: Table = array("levels", dtype=int)  # status of what restricts its part, or -1
    level_freedom: Table = array("levels", dtype=int)  # dimensions that the levels above leave
    level_stopped: Array = array("n")  # as `stopped`, by lower levels
    guarded_levels: int = state(0)  # that are corrected with the loops
    level_tries: int = state(0)  # number of times that lower levels were shortened
    carry: float = state(0.0)  # damping that levels above leave
    first_free: int = state(0)  # first of `axes` that no level uses
    aimed: Array = array("task_rows")  # what the step corrects, to first order
    level_error: Array = array("task_rows")  # what is left for a level
    level_lesser: int = parameter(0)  # as lesser, larger and mobility, or 0 with one level
    level_larger: int = parameter(0)
    level_free: int = parameter(0)
    level_reduced: Array = array("level_lesser", "level_larger")
    level_left: Array = array("level_lesser", "level_lesser")
    level_right: Array = array("level_lesser", "level_larger")
    level_squares: Array = array("level_lesser")
    level_emphasis: Array = array("level_lesser")
    level_axes: Array = array("level_free", "level_free")
    level_kept: Table = array("levels", dtype=int)  # directions in which a level is corrected
    level_in: Array = array("parts", "level_lesser", "task_rows")  # component of an error, in each direction
    level_out: Array = array("parts", "level_lesser", "n")  # joint step that corrects it


class WeightsMemory(DirectionsMemory, part=True):
    """Weights of joints in the motion that tasks leave free: `cinegen.ik._kernels.weights`."""

    weighted: int = parameter(0)  # mobility, or 0 if all weights are the same
    weighted_dof: int = parameter(0)  # n, or 0
    root_weight: Array = array("weighted_dof")
    weighted_rows: Array = array("weighted", "weighted_dof")
    weighted_left: Array = array("weighted", "weighted")
    weighted_right: Array = array("weighted", "weighted_dof")
    weighted_square: Array = array("weighted")


class RecordMemory(DirectionsMemory, part=True):
    """The record of a tick."""

    report: Array = array(REPORT_SIZE, block="record")
    record_q: Array = array("nq", block="record")
    record_v: Array = array("nv", block="record")
    record_errors: Array = array("tasks", 2, block="record")
    record_aims: Array = array("tasks", 4, 3, block="record")
    record_axes: Array = array("tasks", 3, 3, block="record")
    record_tasks: Array = array("tasks", 8, block="record")  # weight, 1 if active, weights of the six axes
    record_levels: Array = array("levels", 2, block="record")  # status, smallest singular value
    record_sigma: Array = array("lesser", block="record")
    record_stopped: Array = array("nv", block="record")


class SolverMemory(LevelsMemory, WeightsMemory, AttemptMemory, RecordMemory):
    """A mechanism that a resolved-rate solver moves. It is divided by idea: a kernel takes the parts that it and those
    that it calls read or write."""

    # set by Python
    second_derivative: float = parameter(math.inf)  # bound of that of any placement by the joints, lengths/rad^2
    tasks_are_suspended: int = parameter(0)
    has_given: int = parameter(0)  # Python gives errors of tasks
    is_guarded: int = parameter(0)  # barriers are evaluated before a trial is accepted
    is_watched: int = parameter(0)  # a tick pauses when its step is proposed

    # the tick
    phase: int = state(0)
    is_at_q: int = state(0)  # frames are evaluated there
    task_distance: float = state(0.0)  # cost of the tasks at the beginning of the tick
    first_speed: float = state(0.0)  # largest motion of a joint by the first level, dimensionless
    turn_scale: float = state(1.0)  # step scale where steps turn back

    # a step that is made if the one out of a singularity fails
    has_spare: int = state(0)
    spare: Array = array("n")
