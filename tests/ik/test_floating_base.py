"""A floating base moves with every task on a node that it carries, in all formats, unless it is loaded as fixed."""

import bipeds
import numpy as np
import pytest
from ticking import beside, of_pinocchio, ticked

import cinegen
from cinegen import Solver, Status
from raff2urdf import to_raff

DT = 1.0 / 240.0
formats = pytest.mark.parametrize("form", ["urdf", "xml", "raff"])


def loaded(folder, form="urdf", **options):
    """The biped in a format; the one in RAFF is converted from the URDF."""
    path = folder / f"biped.{form}"
    if form == "raff":
        (folder / "biped.urdf").write_text(bipeds.URDF)
        to_raff(folder / "biped.urdf", path)
    else:
        path.write_text(bipeds.MJCF if form == "xml" else bipeds.URDF)
    return cinegen.load(path, **options)


def test_a_hand_takes_the_base_along_where_nothing_holds_it(tmp_path):
    mechanism = loaded(tmp_path)
    solver = Solver(mechanism, DT)
    goal = beside(of_pinocchio(mechanism, mechanism.q_home, "hand"), np.array([2.0, 0.0, 1.0]))
    task = solver.add_task("hand", goal)
    step = ticked(solver, 800)
    assert step.status is Status.FOLLOWING
    assert of_pinocchio(mechanism, step.q, "hand").isApprox(goal, 1e-8)
    solver.remove_task(task)
    assert np.array_equal(solver.step().q, step.q)  # without a task it stays


@formats
def test_a_base_that_is_loaded_as_fixed_does_not_move(tmp_path, form):
    free, held = loaded(tmp_path, form), loaded(tmp_path, form, fixed_base=True)
    assert (free.floating, held.floating) == (True, False)
    assert (held.mobility, held.model.nq) == (free.mobility - 6, free.model.nq - 7)
    assert (held.joints, held.actuated, held.nodes) == (free.joints, free.actuated, free.nodes)
    for node in held.nodes:
        assert held.placement(held.q_home, node).isApprox(of_pinocchio(free, free.q_home, node), 1e-12)
    solver = Solver(held, DT)
    solver.add_task("hand", beside(held.placement(held.q_home, "hand"), np.array([2.0, 0.0, 0.0])), rotation=0)
    step = ticked(solver, 300)
    assert step.status is not Status.FOLLOWING
    assert held.placement(step.q, "trunk").isApprox(of_pinocchio(held, held.q_home, "trunk"), 1e-12)
    target = of_pinocchio(held, held.integrate(held.q_home, np.full(held.model.nv, 0.2)), "hand")
    result = cinegen.inverse_kinematics(held, {"hand": target})
    assert result
    assert of_pinocchio(held, result.q, "hand").isApprox(target, 1e-6)


def test_with_a_fixed_base_the_loops_of_a_robot_are_counted_again(raff, root):
    text = (root / "robots" / "four_bar.raff").read_text().partition("\n")[2]
    text = text.replace("base { }", "base { } constraint { base sensor ( 0 ) }")
    free, held = raff(text, name="free"), raff(text, name="held", fixed_base=True)
    assert (free.floating, held.floating) == (True, False)
    assert held.mobility == free.mobility - 6
    assert held.loop_rank == free.loop_rank
