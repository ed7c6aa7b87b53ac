"""The kernels against what they must compute: plain numpy, `cinegen.ik.equations`, `reference_tick`, scipy."""

import gc
import sys

import bipeds
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from quick_kernels import quick
from reference_tick import damping, relative_weights, resolve
from repository import EVERY, load
from scipy.optimize import LinearConstraint, linprog, minimize, nnls
from small_robots import four_bar
from variants import FEWER, others_slow

import cinegen
from cinegen import Solver
from cinegen.ik._kernels import bounds, tasks
from cinegen.ik._kernels.memory import SolverMemory
from cinegen.ik.equations import axes_of, equations, task_rank
from cinegen.ik.thresholds import REST, RESTING
from cinegen.jit import factor, svd
from cinegen.loops._kernels import kinematics, residual
from cinegen.loops._kernels.memory import LoopMemory
from cinegen.loops.motions import free_motions
from cinegen.loops.setup import set_up
from cinegen.loops.thresholds import HEALTHY
from cinegen.tolerances import NEAR_SINGULAR
from raff2urdf.residual import loop_residual

every_robot = pytest.mark.parametrize(("name", "which"), others_slow(EVERY, FEWER))
seeds = st.integers(0, 2**32 - 1)
evaluate, evaluate_loops = quick(kinematics.evaluate), quick(residual.evaluate_loops)
SCALES = (1e-60, 1e-9, 1.0, 1e9, 1e60)


def near(mechanism, pose, rng, away):
    """A pose some way off another, in lengths and rad."""
    turned = pose.rotation @ pin.exp3(away * rng.normal(size=3))
    return pin.SE3(turned, pose.translation + away * mechanism.length * rng.normal(size=3))


# --- loops -------------------------------------------------------------------------------------------------------


@every_robot
def test_rows_and_gaps_of_the_loops_are_the_mechanisms_own_closed_and_open(name, which):
    mechanism = load(name, which)
    if not mechanism.is_constrained:
        return
    rng = np.random.default_rng(0)
    memory = set_up(LoopMemory(), mechanism.structure.system, mechanism.cluster_ranks)
    units = [1.0 if "r" in part else mechanism.length for loop in mechanism.loops for part in loop.components]
    unit = np.array([*units, *mechanism.structure.system.coupling_sizes])
    for q in mechanism.random_closed(6, seed=1):
        for bent in (0.0, 0.3, 3.0):
            q_bent = q + bent * rng.normal(size=len(q)) * mechanism.scale
            evaluate(memory, q_bent)
            largest = evaluate_loops(memory, True)
            assert memory.residual == pytest.approx(mechanism.loop_residual(q_bent) / unit, abs=1e-13)
            assert largest == np.abs(memory.residual).max()
            rows = mechanism.loop_jacobian(q_bent) * mechanism.scale / unit[:, None]
            assert memory.jacobian == pytest.approx(rows, abs=1e-11)
            by_hand = []
            for loop in mechanism.loops:
                first = mechanism.placement(q_bent, loop.first) * loop.first_placement
                second = mechanism.placement(q_bent, loop.second) * loop.second_placement
                by_hand.append(loop_residual(loop.kind, first.actInv(second).homogeneous, mechanism.length)[0])
            of_loops = np.concatenate([np.zeros(0), *by_hand])
            assert memory.residual[: len(of_loops)] == pytest.approx(of_loops, abs=1e-13)


# --- tasks -------------------------------------------------------------------------------------------------------


def all_kinds_of_tasks(mechanism, solver, rng):
    """0 to 3 translations by 0 to 3 rotations, or weights; in the axes of the target, the world, and a node; near and
    far."""
    for axes in ("target", "world", mechanism.nodes[len(mechanism.nodes) // 2]):
        for translation in range(4):
            for rotation in range(4):
                node = str(rng.choice(mechanism.nodes[1:]))
                pose = mechanism.placement(solver.q, node)
                target = near(mechanism, pose, rng, float(rng.choice([1e-9, 1e-3, 0.1, 3.0])))
                solver.add_task(node, target, translation, rotation, float(rng.uniform(0.1, 10.0)), axes)
                weights = rng.uniform(0.01, 3.0, 6) * (rng.random(6) < 0.7)
                solver.add_task(node, target, weights=weights, weight=float(rng.uniform(0.1, 10.0)), axes=axes)


def check_equations(solver):
    """The kernels' rows and errors of all tasks are those of the plain statement."""
    mechanism, system = solver.mechanism, solver.mechanism.structure.system
    system.evaluate(solver.q)
    error, jacobian = equations(mechanism, system, [(task, axes_of(task, mechanism, system)) for task in solver.tasks])
    solver._write_tasks()
    memory = solver._memory
    evaluate(memory, memory.q)
    quick(tasks.read_tasks)(memory)
    quick(tasks.aim_tasks)(memory)
    assert memory.wanted[: memory.active_rows] == pytest.approx(error, abs=1e-12)
    assert memory.task_jacobian[: memory.active_rows] == pytest.approx(jacobian, abs=1e-12)


@every_robot
def test_rows_and_errors_of_all_kinds_of_pulls_are_those_of_the_plain_statement(name, which):
    mechanism, rng = load(name, which), np.random.default_rng(1)
    for q in mechanism.random_closed(3, seed=2):
        solver = Solver(mechanism, 0.01, q=q)
        all_kinds_of_tasks(mechanism, solver, rng)
        check_equations(solver)


def test_a_floating_base_has_columns_for_all_tasks():
    mechanism, rng = cinegen.load(bipeds.URDF), np.random.default_rng(2)
    for node in ("hand", "trunk"):
        solver = Solver(mechanism, 0.01)
        solver.add_task(node, near(mechanism, mechanism.placement(solver.q, node), rng, 0.1))
        check_equations(solver)


# --- the step of a tick ------------------------------------------------------------------------------------------


def plain_levels(solver):
    mechanism, system, before, levels = solver.mechanism, solver.mechanism.structure.system, 0, []
    for priority in sorted({task.priority for task in solver.frame_tasks}):
        tasks = [task for task in solver.frame_tasks if task.priority <= priority]
        rank = task_rank(mechanism, system, tasks)
        system.evaluate(solver.q)
        with_axes = [(task, axes_of(task, mechanism, system)) for task in tasks if task.priority == priority]
        error, rows = equations(mechanism, system, with_axes)
        levels.append((rows, error, relative_weights([task for task, _ in with_axes]), rank - before))
        before = rank
    return levels


def steps_agree(solver, rng, tight, odd=True):
    """One tick from rest against the plain statement, with limits about as near as a step is long; `odd`: or none, or
    touched."""
    mechanism, memory = solver.mechanism, solver._memory
    nv = mechanism.model.nv
    solver._write_tasks()
    on_it = free = np.zeros(nv, dtype=bool)
    if odd:
        on_it, free = rng.random(nv) < (0.2 if tight < 1.0 else 0.0), rng.random(nv) < 0.3
    low, high = np.where(on_it, 0.0, rng.uniform(0.0, tight, (2, nv)))
    low, high = np.where(free, -np.inf, -low), np.where(free, np.inf, high)
    memory.lower[:], memory.upper[:] = solver.q + low * mechanism.scale, solver.q + high * mechanism.scale
    low, high = (memory.lower - solver.q) / mechanism.scale, (memory.upper - solver.q) / mechanism.scale
    levels, (_, loops) = plain_levels(solver), mechanism.structure.system.evaluate(solver.q)
    cut_rates = mechanism.structure.system.cut_rates()
    expected = resolve(loops, mechanism.loop_rank, levels, low, high, memory.longest_step, cut_rates)
    step = solver.step()
    assert (step.q >= memory.lower - 1e-9).all()
    assert (step.q <= memory.upper + 1e-9).all()
    assert mechanism.closure(step.q) <= 1e-9
    if expected is None:
        return "not compared"
    if memory.is_nudged:  # nothing else is to be won
        assert np.abs(expected).max(initial=0.0) <= REST
        return "nudged"
    assert memory.step == pytest.approx(expected, abs=1e-8)
    return "bent" if step.saturated else "slowed" if step.speed_scale < 1.0 else "free"


@every_robot
def test_the_step_of_a_tick_is_that_of_the_plain_statement(name, which):
    """From home on: random closed places, random tasks, limits near and far."""
    mechanism, rng = load(name, which), np.random.default_rng(3)
    seen = []
    for q in [mechanism.q_home, *mechanism.random_closed(20, seed=3)]:
        solver = Solver(mechanism, 1.0, q=q)
        for _ in range(int(rng.integers(1, 3))):
            node = mechanism.nodes[-1] if rng.random() < 0.7 else str(rng.choice(mechanism.nodes[1:]))
            target = near(mechanism, mechanism.placement(q, node), rng, float(rng.choice([1e-3, 1e-2, 0.3])))
            kind = [(3, 3), (3, 0), (2, 1), (1, 2), (0, 3)][rng.integers(5)]
            if rng.random() < 0.7:
                solver.add_task(node, target, *kind, float(rng.uniform(0.3, 3.0)))
            else:
                solver.add_task(node, target, weights=rng.uniform(0.3, 1.0, 6) * (rng.random(6) < 0.8))
        seen.append(steps_agree(solver, rng, float(rng.choice([1e-3, 0.03, 100.0]))))
    assert seen.count("not compared") < 10
    assert "bent" in seen
    assert {"free", "slowed"} & set(seen)


@pytest.mark.parametrize("bent", [0.0, 1e-2])
@pytest.mark.parametrize(("name", "which"), [("arm7", "arm"), ("sr400", "arm")])
def test_near_singularities_too(name, which, bent):
    """All joints at 0 but for a little: arms are stretched, wrists in line."""
    mechanism, rng = load(name, which), np.random.default_rng(4)
    zero = {joint: bent * float(rng.normal()) for joint in mechanism.actuated}
    q = mechanism.close(mechanism.configuration(zero), mechanism.actuated)
    damped, seen = 0, []
    for rotation in (0, 3):
        for _ in range(6):
            solver = Solver(mechanism, 1.0, q=q)
            solver.add_task("tool", near(mechanism, mechanism.placement(q, "tool"), rng, 0.01), 3, rotation)
            damped += solver.step().singular_values[-1] < NEAR_SINGULAR
            solver.q = q
            seen.append(steps_agree(solver, rng, float(rng.choice([1e-3, 100.0]))))
    assert damped
    assert len(seen) == 12
    assert seen.count("not compared") <= (5 if bent < 1e-9 else 1)  # a direction is lost altogether in the former
    if bent > 1e-9:
        assert "bent" in seen


@pytest.mark.parametrize("off", [0.0, 1e-6, 1e-2])
def test_near_a_singularity_of_the_loops_too(off):
    """A parallelogram that lies flat could go on as an antiparallelogram: its loop loses a rank there."""
    tool = 'frame 6 { parameters { d 250 r 100 } pred 2 name "tool" }'
    mechanism = cinegen.load(four_bar((20, -20, 20), (200, 500, 500, 200), more=tool))
    q, rng = mechanism.configuration({"joint1": off, "joint2": -off, "joint3": off}), np.random.default_rng(5)
    assert mechanism.closure(q) < 1e-14
    smallest = Solver(mechanism, 1.0, q=q).step().loop_singular_values[-1]
    assert smallest < 2.0 * off + 1e-12
    for _ in range(5):
        solver = Solver(mechanism, 1.0, q=q)
        solver.add_task("tool", near(mechanism, mechanism.placement(q, "tool"), rng, 0.01), 3, 0)
        if off > 1e-8:  # where the rank is lost two motions are free, and which of them is taken is anyone's choice
            assert steps_agree(solver, rng, 100.0) in ("free", "slowed", "bent")
        else:
            assert np.isfinite(solver.step().q).all()


# --- singular values ---------------------------------------------------------------------------------------------


def check_decomposition(matrix, guess=None):
    (n, width), size = matrix.shape, np.linalg.norm(matrix)
    u = np.full((n, n), np.nan) if guess is None else guess.copy()
    b, square = np.full((n, width), np.nan), np.full(n, np.nan)
    sweeps = svd.decompose(np.ascontiguousarray(matrix), n, width, u, b, square, guess is not None)
    assert (square >= 0.0).all()
    sigma = np.sqrt(square)
    assert u @ u.T == pytest.approx(np.eye(n), abs=1e-13)
    assert b == pytest.approx(u @ matrix, abs=1e-14 * size)
    assert sigma == pytest.approx(np.linalg.svd(matrix, compute_uv=False), abs=1e-14 * size)
    assert (np.diff(sigma) <= 0.0).all()
    if size > 0.0:
        b = b / size
        lengths = np.linalg.norm(b, axis=1)
        real = b[lengths > 1e-14] / lengths[lengths > 1e-14, None]
        assert real @ real.T == pytest.approx(np.eye(len(real)), abs=1e-12)
    return sweeps


def random_matrix(seed):
    """Of any shape from (1, 1) to (6, 12), any rank, and rows of very different length."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 7))
    width = int(rng.integers(n, 13))
    rank = int(rng.integers(0, n + 1))
    matrix = rng.normal(size=(n, rank)) @ rng.normal(size=(rank, width))
    if rng.random() < 0.3:
        matrix *= 10.0 ** rng.uniform(-8.0, 0.0, n)[:, None]
    if n > 1 and rng.random() < 0.3:
        matrix[-1] = matrix[0] * rng.choice([1.0, -1.0, 1.0 + 1e-9])
    return matrix, rng


def orthogonal(rng, n):
    return np.linalg.qr(rng.normal(size=(n, n)))[0]


@settings(max_examples=100)
@given(seeds, st.sampled_from(SCALES))
def test_singular_values_are_numpys_from_nothing_and_from_any_guess(seed, scale):
    matrix, rng = random_matrix(seed)
    assert 1 <= check_decomposition(scale * matrix) <= 15
    assert 1 <= check_decomposition(scale * matrix, orthogonal(rng, len(matrix))) <= 6 + 15


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_what_is_no_number_spoils_nothing_that_comes_after(bad):
    rng = np.random.default_rng(9)
    matrix = rng.normal(size=(4, 6))
    check_decomposition(matrix, np.full((4, 4), bad))  # a guess
    u, b, square, worse = np.eye(4), np.zeros((4, 6)), np.zeros(4), matrix.copy()
    worse[1, 2] = bad
    for each in (matrix, worse, matrix):
        svd.decompose(each, 4, 6, u, b, square, True)
    assert np.sqrt(square) == pytest.approx(np.linalg.svd(matrix, compute_uv=False), abs=1e-13)
    assert u @ u.T == pytest.approx(np.eye(4), abs=1e-13)


def test_singular_vectors_that_are_carried_on_for_long_stay_orthogonal():
    rng = np.random.default_rng(7)
    first, way = rng.normal(size=(6, 7)), rng.normal(size=(2, 6, 7))
    u, b, square = np.eye(6), np.zeros((6, 7)), np.zeros(6)
    worst = 0.0
    for tick in range(20_000):
        t = 1e-3 * tick
        matrix = first + np.sin(t) * way[0] + np.cos(0.7 * t) * way[1]
        if tick % 32 == 0:  # as in a tick
            svd.straighten(u, 6)
        svd.decompose(matrix, 6, 7, u, b, square, tick > 0)
        if tick % 1000 == 31:
            worst = max(worst, np.abs(u @ u.T - np.eye(6)).max())
    assert worst < 1e-13
    assert np.sqrt(square) == pytest.approx(np.linalg.svd(matrix, compute_uv=False), abs=1e-12)


@settings(max_examples=50)
@given(seeds, st.floats(0.0, 1e-3))
def test_what_rounding_has_added_is_straightened(seed, off):
    rng = np.random.default_rng(seed)
    u = orthogonal(rng, 6)
    bent = u + off * rng.uniform(-1.0, 1.0, (6, 6))
    svd.straighten(bent, 6)
    assert bent @ bent.T == pytest.approx(np.eye(6), abs=1e-13)
    assert bent == pytest.approx(u, abs=20.0 * off + 1e-14)


# --- null space --------------------------------------------------------------------------------------------------


def factored(rows, rank):
    """What the rows added at least, the free motions, and the factors."""
    count, n = rows.shape
    f, order, left = rows.copy(), np.zeros(count, dtype=int), np.zeros(count)
    tau, h = np.zeros(max(n, rank)), np.zeros((max(rank, 1), n))
    added = quick(factor.factor)(f, rank, order, left, tau, h)
    free = np.zeros((max(n - rank, 1), n))
    quick(factor.null_space)(rank, tau, h, free)
    return added, free[: n - rank], {"f": f, "rank": rank, "order": order, "tau": tau, "h": h}


def random_rows(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 15))
    rank = int(rng.integers(1, n))
    count = int(rng.integers(rank, rank + 6))
    return rng.normal(size=(count, rank)) @ rng.normal(size=(rank, n)), rank, rng


@settings(max_examples=80)
@given(seeds, st.sampled_from((1e-9, 1.0, 1e9)))
def test_free_motions_are_orthonormal_and_open_no_loop(seed, scale):
    rows, rank, _ = random_rows(seed)
    added, free, _ = factored(scale * rows, rank)
    assert free @ free.T == pytest.approx(np.eye(len(free)), abs=1e-13)
    assert rows @ free.T == pytest.approx(np.zeros((len(rows), len(free))), abs=1e-12 * np.linalg.norm(rows))
    sigma = np.linalg.svd(rows, compute_uv=False)
    assert 0.0 < added <= 1.0
    assert added >= sigma[rank - 1] / sigma[0] / 4.0**rank  # column pivoting knows the rank no worse than that


@settings(max_examples=80)
@given(seeds)
def test_the_shortest_correction_is_the_pseudoinverses(seed):
    rows, rank, rng = random_rows(seed)
    added, _, factors = factored(rows, rank)
    assume(added >= HEALTHY)
    residual, step = rows @ rng.normal(size=rows.shape[1]), np.zeros(rows.shape[1])
    quick(factor.shortest_solution)(right=-residual, out=step, **factors)
    assert step == pytest.approx(-np.linalg.pinv(rows, rcond=1e-9) @ residual, abs=1e-10)
    assert rows @ step == pytest.approx(-residual, abs=1e-11 * np.linalg.norm(rows))


@pytest.mark.parametrize("rank", [1, 2, 3])
def test_rows_that_add_nothing_are_known_and_left_out(rank):
    rows = np.outer([1.0, 2.0, -1.0, 0.0], [0.0, 3.0, 4.0, 0.0, 1.0])
    added, free, factors = factored(rows, rank)
    assert added == (1.0 if rank == 1 else 0.0)
    assert free.shape == (5 - rank, 5)
    assert free @ free.T == pytest.approx(np.eye(5 - rank), abs=1e-15)
    assert rows @ free.T == pytest.approx(np.zeros((4, 5 - rank)), abs=1e-14)
    step = np.zeros(5)
    quick(factor.shortest_solution)(right=-rows @ np.ones(5), out=step, **factors)
    assert step == pytest.approx(-np.linalg.pinv(rows) @ rows @ np.ones(5), abs=1e-13)
    assert factored(np.zeros((4, 5)), rank)[0] == 0.0


# --- bounds ------------------------------------------------------------------------------------------------------


def nearest(wanted, g, low, high):
    """Whether it was found, the point, and what holds it."""
    n, k = g.shape
    memory, held = SolverMemory(n=n, bounds=n, mobility=k, most_active=k + 1), np.full(n, np.nan)
    memory.active_normals[:] = memory.active[:] = np.nan
    memory.wanted_point[:], memory.normals[:] = wanted, g
    success = quick(bounds.nearest)(memory, low, high, held, k)
    return success, memory.wanted_point, held


def check_nearest(wanted, g, low, high):
    """Inside, and optimal: what tasks it away from where it was wanted is held by bounds that push inwards (Karush,
    Kuhn and Tucker; the problem is strictly convex, so nothing else is to be shown)."""
    success, x, held = nearest(wanted, g, low, high)
    size = max(1.0, np.abs(wanted).max())
    assert success
    assert (g @ x <= high + 1e-10 * size).all()
    assert (g @ x >= low - 1e-10 * size).all()
    on = np.flatnonzero(held)
    assert g[on] @ x == pytest.approx(np.where(held > 0.0, high, low)[on], abs=1e-10 * size)
    left = nnls((g[on] * held[on, None]).T, wanted - x)[1] if len(on) else np.linalg.norm(wanted - x)
    assert left <= 1e-8 * size
    return x


def random_bounds(seed):
    """As a tick meets them: 0 is inside, or on the border."""
    rng = np.random.default_rng(seed)
    n, k = int(rng.integers(1, 16)), int(rng.integers(1, 9))
    g, wanted = rng.normal(size=(n, k)), rng.normal(size=k) * 10.0 ** rng.uniform(-2.0, 1.0)
    low, high = -rng.uniform(0.0, 1.0, n), rng.uniform(0.0, 1.0, n)
    low[rng.random(n) < 0.3], high[rng.random(n) < 0.3] = -np.inf, np.inf
    low[rng.random(n) < 0.2], high[rng.random(n) < 0.2] = 0.0, 0.0
    return wanted, g, low, high


@settings(max_examples=80)
@given(seeds)
def test_the_nearest_point_is_inside_and_none_is_nearer(seed):
    """Also with bounds as a loop makes them: joints that turn together, against each other, or not at all; all on
    their bounds."""
    wanted, g, low, high = random_bounds(seed)
    check_nearest(wanted, g, low, high)
    rng = np.random.default_rng(seed)
    for i in range(len(g)):
        j = int(rng.integers(len(g)))
        g[i] = [g[i], g[j], -g[j], 2.0 * g[j], np.zeros(g.shape[1]), g[j] * (1.0 + 1e-13)][rng.integers(6)]
        if rng.random() < 0.3:
            low[i], high[i] = low[j], high[j]
    check_nearest(wanted, g, low, high)


@settings(max_examples=80)
@given(seeds)
def test_a_corner_where_more_bounds_meet_than_there_are_dimensions(seed):
    rng = np.random.default_rng(seed)
    k = int(rng.integers(1, 6))
    g, corner = rng.normal(size=(3 * k, k)), rng.normal(size=k)
    x = check_nearest(corner + rng.normal(size=k), g, np.full(3 * k, -np.inf), g @ corner)
    assert (g @ x <= g @ corner + 1e-9).all()
    out = g.T @ rng.uniform(0.1, 1.0, 3 * k)  # straight out of the corner: it is the nearest
    assert check_nearest(corner + out, g, np.full(3 * k, -np.inf), g @ corner) == pytest.approx(corner, abs=1e-8)


@settings(max_examples=80)
@given(seeds)
def test_bounds_that_contradict_each_other_are_known(seed):
    """Acceleration limits can ask for what position limits forbid: 0 need not be inside."""
    rng = np.random.default_rng(seed)
    n, k = int(rng.integers(2, 10)), int(rng.integers(1, 5))
    g, centre, half = rng.normal(size=(n, k)), rng.normal(size=n), rng.uniform(0.0, 1.0, n)
    low, high = centre - half, centre + half
    # the most that all bounds can be kept by, at once
    rows = np.vstack([np.c_[g, np.ones(n)], np.c_[-g, np.ones(n)]])
    room = linprog([*np.zeros(k), -1.0], rows, [*high, *-low], bounds=(None, None))
    wanted = rng.normal(size=k)
    if room.x[-1] > 1e-6:
        check_nearest(wanted, g, low, high)
    elif room.x[-1] < -1e-6:
        assert not nearest(wanted, g, low, high)[0]


# --- memory ------------------------------------------------------------------------------------------------------


def test_ticks_leave_nothing_behind():
    mechanism = load("five_bar", "linkage")
    solver = Solver(mechanism, 0.01)
    task = solver.add_task("tool", rotation=0)
    targets = [near(mechanism, task.target, np.random.default_rng(8), 0.1) for _ in range(50)]

    def run(ticks):
        for tick in range(ticks):
            task.target = targets[tick // 20 % 50]
            solver.step()
        gc.collect()
        return sys.getallocatedblocks()

    before = run(2000)
    collected = gc.get_stats()[0]["collections"]
    assert run(20_000) - before < 100
    assert gc.get_stats()[0]["collections"] - collected < 100  # a step is no cycle that the collector has to find


# --- the yardstick itself --------------------------------------------------------------------------------------------


@given(seeds)
def test_with_bounds_it_is_the_best_of_all_steps_within_them(seed):
    """Against a general optimiser, on the function that the docstring states."""
    rng = np.random.default_rng(seed)
    loops, tasks = rng.normal(size=(4, 2)) @ rng.normal(size=(2, 7)), rng.normal(size=(3, 7))
    error = rng.normal(size=3)
    low, high = -rng.uniform(0.0, 0.4, 7), rng.uniform(0.0, 0.4, 7)
    step = resolve(loops, 2, [(tasks, error, np.ones(3), 3)], low, high, np.full(7, np.inf))
    assert np.abs(loops @ step).max() < 1e-9
    assert (step <= high + 1e-11).all()
    assert (step >= low - 1e-11).all()
    motions, _ = free_motions(loops, 2)
    _, sigma, wt = np.linalg.svd(tasks @ motions)
    weight = np.concatenate([damping(sigma, float(np.linalg.norm(error))), np.full(2, RESTING)])

    def cost(y):
        return np.sum((tasks @ motions @ y - error) ** 2) + weight @ (wt @ y) ** 2

    within = LinearConstraint(motions, low, high)
    best = minimize(cost, np.zeros(5), constraints=[within], method="SLSQP", options={"ftol": 1e-14, "maxiter": 500})
    assert cost(motions.T @ step) <= best.fun + 1e-6


def test_the_free_motions_keep_their_width_where_the_loops_lose_a_rank():
    loops = np.diag([1.0, 1.0, 1e-14, 0.0])
    motions, sigma = free_motions(loops, 3)
    assert motions.shape == (4, 1)
    assert sigma == pytest.approx([1.0, 1.0, 0.0], abs=1e-13)
