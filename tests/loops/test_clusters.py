"""Clusters of loops that share no joint: found, closed and solved each by itself; a hundred on a thousand joints."""

from functools import cache

import numpy as np
import pytest
from repository import module_of

import cinegen
from cinegen.errors import ClosureError
from cinegen.loops.clusters import clusters, subsystems
from cinegen.loops.motions import free_motions

large = module_of("benchmarks/large.py")
FAMILIES = ("chain", "snake", "star", "train", "girder")


@cache
def made(family: str, joints: int) -> cinegen.Mechanism:
    return cinegen.load(large.FAMILIES[family](joints))


def dragged(
    mechanism: cinegen.Mechanism, ticks: int = 300, radius: float = 0.01, wait: int = 30
) -> tuple[cinegen.Solver, float]:
    """Lead the end along a circle of some mm, and wait; loops are closed at every tick. Return what is left, m."""
    solver = cinegen.Solver(mechanism, 1e-3)
    target = mechanism.placement(mechanism.q_home, mechanism.end)
    task, home = solver.add_task(mechanism.end, target, rotation=0), target.translation.copy()
    for i in range(ticks + wait):
        about = 2.0 * np.pi * min(i + 1, ticks) / ticks
        target.translation = home + radius * np.array([np.sin(about), 1.0 - np.cos(about), 0.0])
        task.target = target
        step = solver.step()
        assert step.closure <= 1e-10
        assert mechanism.closure(step.q) <= 1e-10
    return solver, step.errors[0][0]


@pytest.mark.parametrize("family", FAMILIES)
def test_mobility_is_as_counted_by_hand_and_loops_stay_closed(family):
    mechanism = made(family, 30)
    assert mechanism.mobility == large.MOBILITY[family](30)
    assert len(mechanism.actuated) == mechanism.mobility
    single = family in ("train", "girder")
    assert len(mechanism.cluster_ranks) == (1 if single else len(mechanism.loops))
    dragged(mechanism, ticks=100)


def test_loops_of_a_large_cluster_stay_closed():
    dragged(made("girder", 120), ticks=20, radius=0.001, wait=0)


def test_modes_of_many_loops_are_refused():
    with pytest.raises(cinegen.CinegenError, match="120 independent equations"):
        cinegen.assembly_modes(made("snake", 600))


# --- clusters ------------------------------------------------------------------------------------------------------

FOUR_BARS = """RAFF two
robot r {{ base {{ }}
link 1 {{ parameters {{ theta 80 }} type 2 pred 0 }} link 2 {{ parameters {{ theta -80 d 60 }} type 2 pred 1 }}
link 3 {{ parameters {{ theta 80 d 80 }} type 2 pred 0 }} frame 4 {{ parameters {{ d 80 }} pred 2 }}
frame 5 {{ parameters {{ d {rocker} }} pred 3 }} constraint {{ frame 4 frame 5 type 2 }}
link 6 {{ parameters {{ theta 10 d 50 }} type 2 pred 2 }}
link 11 {{ parameters {{ theta 80 d 200 }} type 2 pred 6 }} link 12 {{ parameters {{ theta -80 d 60 }} type 2 pred 11 }}
link 13 {{ parameters {{ theta 80 d 280 }} type 2 pred 6 }} frame 14 {{ parameters {{ d 80 }} pred 12 }}
frame 15 {{ parameters {{ d 60 }} pred 13 }} constraint {{ frame 14 frame 15 type 2 }} {more} }}
"""


def two(rocker: float = 60.0, more: str = "") -> cinegen.Mechanism:
    """Two four-bar linkages; a joint between them, and one that carries the second, are in no loop."""
    return cinegen.load(FOUR_BARS.format(rocker=rocker, more=more))


def test_loops_that_share_no_joint_are_clusters():
    mechanism = two()
    first, second = clusters(mechanism.structure.system)
    names = [{mechanism.columns[k] for k in cluster.columns} for cluster in (first, second)]
    assert names == [{"joint1", "joint2", "joint3"}, {"joint11", "joint12", "joint13"}]
    assert [cluster.rows.tolist() for cluster in (first, second)] == [[0, 1, 2, 3, 4], [5, 6, 7, 8, 9]]
    assert (mechanism.cluster_ranks, mechanism.mobility) == ((2, 2), 3)
    jacobian = mechanism.structure.system.evaluate(mechanism.q_home)[1]
    for cluster in (first, second):
        outside = np.setdiff1d(np.arange(7), cluster.columns)
        assert not jacobian[np.ix_(cluster.rows, outside)].any()


def test_a_coupling_links_clusters():
    mechanism = two(more="coupling { link 11 link 1 ratio 1 offset 0 }")
    (cluster,) = clusters(mechanism.structure.system)
    assert (cluster.loops, cluster.couplings) == ((0, 1), (0,))
    assert (mechanism.cluster_ranks, mechanism.mobility) == ((5,), 2)


@pytest.mark.parametrize("locked", [(), ("joint2", "joint13")])
def test_a_cluster_alone_has_the_equations_that_it_has_in_the_mechanism(locked):
    """A locked joint is part of the link that carries it: each cluster has one joint less."""
    mechanism = two()
    q = mechanism.q_home + 0.2 * np.random.default_rng(3).normal(size=7)
    system = (mechanism.with_held(locked, q) if locked else mechanism).structure.system
    residual, jacobian = system.evaluate(q)
    parts = subsystems(system)
    assert len(parts) == 2
    for cluster, (part, at) in zip(clusters(system), parts, strict=True):
        alone, own_jacobian = part.evaluate(q[at])
        assert len(at) == 3 - bool(locked)
        assert alone == pytest.approx(residual[cluster.rows], abs=1e-14)
        assert own_jacobian == pytest.approx(jacobian[np.ix_(cluster.rows, cluster.columns)], abs=1e-14)


def test_an_open_cluster_is_named_and_no_other():
    with pytest.raises(ClosureError) as caught:
        two(rocker=500.0)
    assert "'frame4-frame5'" in str(caught.value)
    assert "frame14" not in str(caught.value)


def test_a_cluster_that_can_not_be_closed_does_not_keep_others_open():
    mechanism = two()
    q, mask = mechanism.q_home + 0.05, np.zeros(7)
    mask[[mechanism.v_index(name) for name in ("joint1", "joint2", "joint3")]] = 1.0
    closing = mechanism.structure.closer.close(q, mask)
    assert not closing.closed
    residual = np.abs(mechanism.structure.system.evaluate(closing.q)[0])
    assert residual[5:].max() <= 1e-12
    joints = [mechanism.q_index(f"joint{number}") for number in (1, 2, 3, 6)]
    assert np.array_equal(closing.q[joints], q[joints])


def test_random_configurations_move_all_joints_of_several_clusters():
    mechanism = two()
    samples = np.array(mechanism.random_closed(4))
    assert samples.shape == (4, 7)
    assert (np.abs(samples - mechanism.q_home).max(axis=0) > 0.05).all()
    assert max(mechanism.closure(q) for q in samples) <= 1e-12


def test_motions_of_large_jacobians_are_those_of_their_singular_vectors():
    mechanism = made("girder", 120)
    jacobian = mechanism.structure.system.evaluate(mechanism.random_closed(1)[0])[1]
    motions, sigma = free_motions(jacobian, mechanism.loop_rank)
    assert motions.shape == (mechanism.model.nv, mechanism.mobility)
    assert motions.T @ motions == pytest.approx(np.eye(mechanism.mobility), abs=1e-12)
    assert jacobian @ motions == pytest.approx(np.zeros((len(jacobian), mechanism.mobility)), abs=1e-12)
    assert sigma == pytest.approx(np.linalg.svd(jacobian, compute_uv=False)[: mechanism.loop_rank], abs=1e-12)
