"""Closing loops from where they are not closed, and what is said where that can't be done."""

import re
from functools import cache
from itertools import pairwise
from random import Random

import mechanisms
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from making import REVOLUTE, RIGID, Body, axis
from mechanisms import CLOSED_CHAINS, FOUR_BAR_AXES, KNOWN, cluster_of, clusters_of, raff_of, ring, shift, turn
from scipy.optimize import least_squares
from strategies import documents

from raff2urdf import loads
from raff2urdf.closure import close, passive, rank
from raff2urdf.errors import RaffClosureError
from raff2urdf.loops.mobility import Analysis, analyse
from raff2urdf.raff.document import Document, LoopKind
from raff2urdf.tree import Cluster, placements

MET = 1e-11  # m or rad: CLOSED, times the size of these mechanisms and some rounding

seeds = st.integers(0, 2**32 - 1)
chains = st.sampled_from(CLOSED_CHAINS)


@cache
def analysed(document: Document) -> Analysis:
    return analyse(document, document.robot())


def perturbed(cluster: Cluster, seed: int, size: float) -> np.ndarray:
    step = np.random.default_rng(seed).normal(size=len(cluster.home)) * size
    return cluster.integrate(cluster.home, step)


def apart(document: Document, cluster: Cluster, q: np.ndarray) -> float:
    """How far the ends of a cluster's loops are apart, seen from the tree alone (m or rad)."""
    robot = document.robot()
    placed = placements(document, robot, dict(zip([joint.joint for joint in cluster.joints], q, strict=True)))
    worst = 0.0
    for index in cluster.loops:
        loop = robot.loops[index]
        between = np.linalg.inv(placed[loop.first]) @ placed[loop.second]
        off = [between[:2, 3] if loop.kind is LoopKind.PRISMATIC else between[:3, 3]]
        if loop.kind in (LoopKind.RIGID, LoopKind.PRISMATIC):
            off.append(pin.log3(between[:3, :3]))
        elif loop.kind is LoopKind.REVOLUTE:
            off.append(between[:3, 2] - [0.0, 0.0, 1.0])  # z upon z, and in the same direction
        worst = max(worst, *(float(np.abs(part).max()) for part in off))
    return worst


# --- closing -----------------------------------------------------------------------------------------------------


@given(chains, seeds, st.sampled_from([1e-6, 1e-3, 0.1, 0.3]), st.booleans())
@settings(max_examples=160)
def test_a_mechanism_pulled_apart_closes_again(name, seed, size, is_held):
    """Also with its actuated joints held, and once more where it is closed, without moving."""
    document = loads(KNOWN[name][0])
    (cluster,) = clusters_of(document)
    assume(name != "truss" or size <= 0.1)
    assume(not is_held or (size <= 1e-3 and name not in ("truss", "flat parallelogram")))
    held = analysed(document).actuated if is_held else ()
    free = np.array([joint.joint not in held for joint in cluster.joints])
    q = perturbed(cluster, seed, size)
    closing = close(cluster, q, free)
    assert closing.closed
    assert apart(document, cluster, closing.q) <= MET
    assert (closing.q[~free] == q[~free]).all()
    assert np.abs(close(cluster, closing.q, free).q - closing.q).max() <= 1e-12 * max(1.0, np.abs(closing.q).max())


class Watched:
    """A system that knows how often it was evaluated, and how large its steps were."""

    def __init__(self, cluster: Cluster) -> None:
        self.cluster, self.evaluations, self.largest = cluster, 0, 0.0

    def evaluate(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self.evaluations += 1
        return self.cluster.evaluate(q)

    def integrate(self, q: np.ndarray, step: np.ndarray) -> np.ndarray:
        self.largest = max(self.largest, float(np.abs(step).max()))
        return self.cluster.integrate(q, step)


@given(chains.filter(lambda name: name != "flat parallelogram"), seeds)
def test_closing_converges_quadratically(name: str, seed: int) -> None:
    """From 1e-3, the gap goes as 1e-3, 1e-6, 1e-12: a handful of evaluations, dependent rows or not."""
    watched = Watched(cluster_of(KNOWN[name][0]))
    assert close(watched, perturbed(watched.cluster, seed, 1e-3)).closed
    assert watched.evaluations <= 5


@given(chains.filter(lambda name: name not in ("flat parallelogram", "Sarrus", "Bennett")), seeds)
@settings(max_examples=60)
def test_closing_is_the_shortest_correction(name: str, seed: int) -> None:
    """To first order it is the pseudo-inverse's: nothing moves along what the loops leave free.

    Not so where rows depend on each other in closed configurations only: pulled apart, they are a direction of their
    own, with a singular value that is as small as the gap.
    """
    cluster = cluster_of(KNOWN[name][0])
    q = perturbed(cluster, seed, 1e-4)
    residual, jacobian = cluster.evaluate(q)
    expected = -np.linalg.pinv(jacobian, rcond=1e-3) @ residual
    moved = (close(cluster, q).q - q) / cluster.scale
    assert np.abs(moved - expected).max() <= 0.01 * np.abs(expected).max()


def test_closing_ends_where_no_step_can_lower_the_gap() -> None:
    """Two circles of radius 1, whose centres are 2.001 apart, are nearest on the line between these."""

    circles = mechanisms.Circles(2.001)
    closing = close(circles, np.array([0.3, -0.2]))
    assert closing.gap == pytest.approx(1e-3, rel=1e-6)
    circles.evaluations = 0
    assert close(circles, closing.q).gap == closing.gap
    assert circles.evaluations <= 3


@given(chains, seeds, st.floats(0.01, 3.0))
@settings(max_examples=40)
def test_closing_never_ends_farther_open_than_it_began_and_leaves_its_input_alone(name, seed: int, size: float) -> None:
    cluster = cluster_of(KNOWN[name][0])
    q = perturbed(cluster, seed, size)
    before = q.copy()
    residual, _ = cluster.evaluate(q)
    closing = close(cluster, q, iterations=seed % 5)
    assert (q == before).all()
    assert np.linalg.norm(cluster.evaluate(closing.q)[0]) <= np.linalg.norm(residual)
    assert closing.gap == np.abs(cluster.evaluate(closing.q)[0]).max()


@given(chains, seeds)
def test_no_step_goes_farther_than_a_linearisation_can_know(name: str, seed: int) -> None:
    """A radian, or a characteristic length, however far the way."""
    watched = Watched(cluster_of(KNOWN[name][0]))
    close(watched, perturbed(watched.cluster, seed, 3.0))
    assert 0.0 < watched.largest <= 1.0


# --- the equations -----------------------------------------------------------------------------------------------


@given(documents(moderate=True, least_robots=1, graphics=False), seeds)
@settings(max_examples=80)
def test_the_loops_jacobian_is_that_of_finite_differences(document: Document, seed: int) -> None:
    """For any tree and any kinds of loops, open as they are."""
    rng = np.random.default_rng(seed)
    for cluster in clusters_of(document):
        q = cluster.integrate(cluster.home, rng.normal(size=len(cluster.home)))
        residual, jacobian = cluster.evaluate(q)
        assert jacobian.shape == (len(residual), len(q))
        assume(np.abs(residual).max(initial=0.0) < 2.5)  # no rotation near a half turn, where it jumps
        for column, step in enumerate(1e-6 * np.eye(len(q))):
            ahead, behind = (cluster.evaluate(cluster.integrate(q, sign * step))[0] for sign in (1.0, -1.0))
            numeric = (ahead - behind) / 2e-6
            assert np.abs(jacobian[:, column] - numeric).max() <= 1e-7 * max(1.0, np.abs(jacobian).max()) ** 2


def test_loops_that_share_joints_are_closed_together_and_others_by_themselves() -> None:
    o, a, b, c = FOUR_BAR_AXES
    bodies = [Body(1, 0, o), Body(2, 1, a), Body(3, 0, c), Body(4, 2, b, None), Body(5, 3, b, None)]
    twice_closed = raff_of(bodies, (4, 5, REVOLUTE), (4, 5, REVOLUTE))
    clusters = clusters_of(loads(mechanisms.side_by_side(twice_closed, twice_closed)))
    assert [cluster.loops for cluster in clusters] == [[0, 1], [2, 3]]
    assert [[joint.number for joint in cluster.joints] for cluster in clusters] == [[11, 12, 13], [21, 22, 23]]
    assert [len(cluster.loops) for cluster in clusters_of(loads(mechanisms.delta()))] == [2]


def test_joints_that_move_both_ends_of_a_loop_alike_are_no_part_of_it() -> None:
    """A four-bar at the end of an arm of two joints."""
    bodies = [Body(21, 0, axis((0, 0, -1), (1, 0, 0))), Body(22, 21, axis((0, 0, -0.5), (0, 1, 0)))]
    o, a, b, c = FOUR_BAR_AXES
    bodies += [Body(1, 22, o), Body(2, 1, a), Body(3, 22, c), Body(4, 2, b, None), Body(5, 3, b, None)]
    cluster = cluster_of(raff_of(bodies, (4, 5, REVOLUTE)))
    assert [joint.number for joint in cluster.joints] == [1, 2, 3]


# --- rank --------------------------------------------------------------------------------------------------------


@st.composite
def matrices(draw: st.DrawFn) -> tuple[np.ndarray, int]:
    """A matrix of known rank, with columns that are multiples of others. What is below 1e-9 opens no loop."""
    rows, inner = draw(st.integers(1, 8)), draw(st.integers(0, 8))
    picked = draw(st.lists(st.integers(0, 7), min_size=1, max_size=8))
    rng = np.random.default_rng(draw(seeds))
    columns = rng.normal(size=(rows, inner)) @ rng.normal(size=(inner, 8))
    matrix = columns[:, picked] * rng.uniform(0.5, 2.0, size=len(picked))
    return matrix * 10.0 ** draw(st.integers(-6, 9)), min(rows, inner, len(set(picked)))


@given(matrices())
@settings(max_examples=100)
def test_the_rank_is_the_number_of_independent_rows(made: tuple[np.ndarray, int]) -> None:
    matrix, expected = made
    assert rank(matrix) == expected


@pytest.mark.parametrize("size", [1e-2, 1.0, 1e3])
def test_a_singular_value_is_small_beside_the_largest(size: float) -> None:
    turned = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    assert rank(size * turned @ np.diag([1.0, 1e-5, 5e-7])) == 2


def test_nothing_has_rank_0() -> None:
    assert [rank(np.zeros(shape)) for shape in ((0, 3), (3, 0), (3, 3))] == [0, 0, 0]


@given(matrices(), st.randoms(use_true_random=False))
@settings(max_examples=100)
def test_passive_joints_are_the_first_in_order_that_depend_on_none_before_them(made, random: Random) -> None:
    matrix, expected = made
    order = list(range(matrix.shape[1]))
    random.shuffle(order)
    size = np.abs(matrix).max() or 1.0
    ranks = [np.linalg.matrix_rank(matrix[:, order[:n]] / size, tol=1e-9) for n in range(len(order) + 1)]
    first = [column for column, (before, after) in zip(order, pairwise(ranks), strict=True) if after > before]
    assert passive(matrix, order) == first
    assert len(first) == expected


# --- what can't be closed ----------------------------------------------------------------------------------------


def why(text: str) -> str:
    with pytest.raises(RaffClosureError) as caught:
        analysed(loads(text))
    return str(caught.value)


def out_of_reach() -> str:
    """A four-bar whose rocker and crank stand two metres farther apart than its coupler is long."""
    return ring(FOUR_BAR_AXES, off=shift("x", 2.0))


def two_bars_with_a_wrong_angle() -> str:
    """They meet a point of the base at any angle but the one in which they are welded to it."""
    end = axis((0.5, 0, 0))
    bars = [Body(1, 0, axis((0, 0, 0))), Body(2, 1, axis((0.2, 0.4, 0)))]
    return raff_of([*bars, Body(3, 2, end, None), Body(4, 0, end @ turn("z", 0.3), None)], (3, 4, RIGID))


def test_a_loop_that_stays_open_is_named_with_its_least_gap_and_its_rows_against_their_rank():
    """scipy's least squares finds no better configuration around."""
    said, cluster = why(mechanisms.skew_four_bar()), cluster_of(mechanisms.skew_four_bar())
    named = re.search(r"robot 'r'.*can't be closed.*'frame5-frame6' \(rigid, ([\d.]+) mm.* and ([\d.]+) degrees", said)
    assert named is not None
    assert "6 loop rows of rank 4 on 4 joints" in said
    best = least_squares(lambda q: cluster.evaluate(q)[0], cluster.home, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    sizes = np.linalg.norm(best.fun[:3]) * 1e3 * cluster.length, np.degrees(np.linalg.norm(best.fun[3:]))
    assert [float(number) for number in named.groups()] == pytest.approx(sizes, rel=0.01)


@pytest.mark.parametrize(("turned", "edit"), [
    (turn("z", np.radians(40.0)) @ turn("x", np.pi), "alpha 180"),
    (turn("y", np.radians(-70.0)), "gamma 90 alpha 70 theta -90"),
], ids=["opposed and rotated", "tilted"])  # fmt: skip
def test_hinges_whose_axes_differ_are_told_with_the_frame_that_helps_and_it_does(turned: np.ndarray, edit: str) -> None:
    """A ball joint would close it, too, and let the link spin."""
    text = ring(FOUR_BAR_AXES, off=turned)
    said = why(text)
    angle = np.degrees(np.arccos(turned[2, 2]))
    apart = "point against each other" if angle > 179.5 else f"are {angle:.4g} degrees apart"
    assert f"the z axes of frame5 and frame6 {apart} as written" in said
    remedy = re.search(r"It closes with a frame on frame6, '(parameters \{ .* \})', as that end of the loop", said)
    assert remedy is not None, said
    numbers = [[float(x) for x in re.findall(r"-?[\d.]+", edit_text)] for edit_text in (remedy[1], edit)]
    assert numbers[0] == pytest.approx(numbers[1], abs=1e-4)
    assert "ball" not in said
    frame = f"frame 7 {{ {remedy[1]} pred 6 }}"
    document = loads(text.replace("constraint { frame 5 frame 6", f"{frame} constraint {{ frame 5 frame 7"))
    assert analysed(document).mobility == 1


def test_a_gap_is_told_by_its_axis() -> None:
    """A point that can only move along x is 30 mm off along y."""
    text = """RAFF slider robot r { link 1 { parameters { gamma 90 alpha 90 theta -90 r 200 } type 1 pred 0 }
      frame 2 { parameters { gamma 90 d 30 } pred 0 } constraint { frame 2 link 1 type 3 } }"""
    assert "'frame2-link1' (ball, 30 mm along x)" in why(text)


@pytest.mark.parametrize(("text", "kind"), [
    (mechanisms.skew_four_bar(), "ball"), (two_bars_with_a_wrong_angle(), "revolute"),
], ids=["skew axes", "a wrong angle"])  # fmt: skip
def test_a_weaker_closure_that_works_is_named_and_works(text: str, kind: str) -> None:
    (loop,) = loads(text).robot().loop_names
    assert f'it closes with {kind} joints there: loops={{"{loop}": "{kind}"}}' in why(text)
    document = loads(text)
    assert analyse(document, document.robot(), {loop: kind}).kinds == (LoopKind[kind.upper()],)


def test_where_no_weaker_closure_helps_that_is_said() -> None:
    assert "neither revolute nor ball joints there would close it" in why(out_of_reach())


@pytest.mark.parametrize("beside", [mechanisms.four_bar(), out_of_reach()], ids=["closed", "open"])
def test_all_loops_that_stay_open_are_named_and_no_others(beside: str) -> None:
    """A four-bar that is out of reach, and another one on the same base."""
    said = why(mechanisms.side_by_side(beside, out_of_reach()))
    assert "'frame25-frame26'" in said
    assert ("'frame15-frame16'" in said) == (beside != mechanisms.four_bar())
