"""Rods that spin about themselves: found, never actuated, left out of modes and of what is uncontrolled, held still."""

import numpy as np
import pinocchio as pin
import pytest
from making import platform

import cinegen
import raff2urdf
from raff2urdf.loops.mobility import analyse

LEGS = [
    (("SPS",) * 6, 6, "P"),  # a hexapod whose legs are free to turn
    (("UPS",) * 6, 0, "P"),
    (("RSS",) * 6, 6, "R"),
    (("PSS",) * 6, 6, "P"),
    (("RSS", "UPS", "SPS", "RUS", "RUS", "PUS"), 2, None),
    (("SRS",) + ("UPS",) * 5, 0, None),  # a bent leg swings about the line between its ball joints: a real motion
]


@pytest.fixture(params=LEGS, ids=lambda legs: "-".join(dict.fromkeys(legs[0])))
def legs(request):
    return request.param


@pytest.mark.parametrize("cut", ["rigid", "joint"])
def test_they_are_found_and_no_actuated_joint_drives_them(legs, cut):
    """Each turns bodies of one leg about a line, and moves nothing else: by Pinocchio's velocities of all bodies."""
    words, idle, driven = legs
    text = "RAFF legs\n" + platform(np.random.default_rng(3), words, cut).text(joint_digits=None)
    mechanism = cinegen.load(text)
    structure, model = mechanism.structure, mechanism.model
    swing = int("SRS" in words)
    assert (mechanism.mobility, len(structure.idle), structure.uncontrolled_dof) == (6 + idle + swing, idle, 0)
    assert len(mechanism.actuated) == 6 + swing
    if driven is not None:
        assert all(mechanism.is_prismatic(joint) == (driven == "P") for joint in mechanism.actuated)
    for q in mechanism.random_closed(3, seed=1):
        motions = structure.idle_motions(q)
        assert np.linalg.matrix_rank(motions) == idle
        assert np.abs(mechanism.loop_jacobian(q) @ motions.T).max(initial=0.0) < 1e-9
        passive = np.delete(mechanism.loop_jacobian(q), [mechanism.v_index(j) for j in mechanism.actuated], axis=1)
        assert np.linalg.matrix_rank(passive) == passive.shape[1] - idle
        for motion, spin in zip(motions * mechanism.scale, structure.idle, strict=True):
            data = model.createData()
            pin.forwardKinematics(model, data, q, motion)
            twists = np.array([data.oMi[j].act(data.v[j]).vector for j in range(model.njoints)])
            fast = {j for j in range(model.njoints) if np.abs(twists[j]).max() > 1e-9}
            leg = {j for body in spin.bodies for j in (*model.supports[body], *model.subtrees[body])} - {0}
            assert fast <= leg
            assert not motion[[mechanism.v_index(joint) for joint in mechanism.actuated]].any()
            for body in spin.bodies:  # a rotation: no translation along its axis
                assert twists[body][:3] @ twists[body][3:] == pytest.approx(0.0, abs=1e-9)
    document = raff2urdf.loads(text)
    assert analyse(document, document.robot()).actuated == mechanism.actuated


def test_a_tip_on_two_coaxial_hinges_is_no_rod(tmp_path):
    """Its angle matters: it is the end of a five-bar."""
    text = """RAFF tip
    robot r {
      link 1 { parameters { theta 100 } type 2 pred 0 }
      link 2 { parameters { d 200 theta -60 } type 2 pred 1 }
      link 3 { parameters { d 250 theta 20 } type 2 pred 2 }
      link 4 { parameters { d 300 theta 80 } type 2 pred 0 }
      link 5 { parameters { d 200 theta 60 } type 2 pred 4 }
      frame 6 { parameters { d 250 } pred 5 }
      constraint { link 3 frame 6 type 2 }
    }"""
    mechanism = cinegen.load(text)
    assert (mechanism.mobility, mechanism.structure.idle) == (3, ())
    assert len(mechanism.actuated) == 3
    assert not mechanism.uncontrolled


def test_a_joint_that_the_file_states_to_be_actuated_drives_a_spin():
    text = "RAFF legs\n" + platform(np.random.default_rng(3), ("SPS",) * 6, "joint").text(joint_digits=None)
    free = cinegen.load(text)
    made = cinegen.load(text, actuated=[*free.actuated, free.joints[0]])
    assert len(made.structure.idle) == 5
    assert made.structure.uncontrolled_dof == 0


def test_the_solver_holds_them_still():
    """A platform on rods is dragged: no rod turns about itself, by Pinocchio's velocities."""
    mechanism = cinegen.load(
        "RAFF legs\n" + platform(np.random.default_rng(3), ("SPS",) * 6, "joint").text(joint_digits=None)
    )
    solver = cinegen.Solver(mechanism, dt=0.01)
    task = solver.add_task("tool")
    task.target.translation += [0.05, 0.02, 0.08]
    spins = mechanism.structure.idle
    before = solver.q
    for _ in range(40):
        q = solver.q
        solver.step()
        step = pin.difference(mechanism.model, q, solver.q) / mechanism.scale
        for motion in mechanism.structure.idle_motions(q):
            assert abs(float(step @ motion)) < 1e-2 * np.linalg.norm(step) + 1e-9
    assert len(spins) == 6
    assert np.abs(solver.q - before).max() > 1e-2


def test_modes_are_counted_without_them(tmp_path):
    """A crank moves a rocker by a rod between ball joints: two configurations for each angle of the crank."""
    text = """RAFF rssr
    robot r {
      link 1 { actuated 1 parameters { theta 40 } type 2 pred 0 }
      frame 2 { parameters { d 100 } pred 1 }
      link 3 { parameters { d 400 alpha 70 r 50 theta 75 } type 2 pred 0 }
      link 4 { parameters { d 300 theta 30 } type 2 pred 3 }
      link 5 { parameters { alpha 90 theta 90 } type 2 pred 4 }
      link 6 { parameters { alpha 90 theta 20 } type 2 pred 5 }
      frame 7 { parameters { d 380 } pred 6 }
      constraint { frame 2 frame 7 type 3 }
    }"""
    mechanism = cinegen.load(text)
    assert (mechanism.mobility, len(mechanism.structure.idle), mechanism.actuated) == (2, 1, ("joint1",))
    found = cinegen.assembly_modes(mechanism)
    rockers = {round(float(q[mechanism.q_index("joint3")]), 6) for q in found.configurations}
    assert len(found.configurations) == len(rockers) == 2
