"""Characteristic length and singular values of the repository's robots: the same in every format, and however drawn."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from loop_openings import pin_screws
from test_screws import Form, Joint, described
from variants import slow

import cinegen
from cinegen.ik.singular import passive_singular_values
from cinegen.loops.screws import LoopScrews
from raff2urdf.conversion import convert
from raff2urdf.raff.document import LoopKind

ROBOTS = ["four_bar", "five_bar", "planar_hybrid", "delta4", "delta4_linear", "gough", "hybrid", "sr400", "tssm"]


def test_a_four_bar_has_those_of_its_closed_form(robot):
    bar = robot("four_bar")
    for q in [bar.q_home, *bar.random_closed(5, seed=2)]:
        now, home = (
            np.array([bar.placement(at, node).translation[:2] for node in ("link1", "link2", "link3", "frame4")])
            for at in (q, bar.q_home)
        )
        values = np.linalg.svd(pin_screws(now, home), compute_uv=False)
        assert bar.loop_singular_values(q) == pytest.approx(values, abs=1e-12)
        assert bar.length == pytest.approx(math.sqrt(3.0 * ((home - home.mean(axis=0)) ** 2).sum() / 4.0))
    assert bar.length == pytest.approx(0.36128, abs=5e-6)
    assert bar.loop_singular_values(bar.q_home) == pytest.approx([2.0, 1.8235, 0.8215], abs=5e-5)


@pytest.mark.parametrize("format", ["urdf", "sdf", "mjcf"])
@pytest.mark.parametrize(
    "name", ["delta4", "sr400", *slow(*(name for name in ROBOTS if name not in ("delta4", "sr400")))]
)
def test_they_do_not_depend_on_the_format(robot, root, tmp_path, name, format):
    there = robot(name)
    (made,) = convert(root / f"robots/{name}.raff", tmp_path, format=format)
    back = cinegen.load(made.file)
    assert back.length == pytest.approx(there.length, rel=1e-9)
    for q in [there.q_home, *there.random_closed(3, seed=1)]:
        p = back.configuration({joint: q[there.q_index(joint)] for joint in there.joints})
        assert back.closure(p) < 1e-9
        assert back.loop_singular_values(p) == pytest.approx(there.loop_singular_values(q), abs=1e-8)
        assert passive_singular_values(back, p) == pytest.approx(passive_singular_values(there, q), abs=1e-8)


@pytest.mark.parametrize("seed", [0, *slow(1, 2, 3)])
@pytest.mark.parametrize("name", ROBOTS)
def test_they_do_not_depend_on_cuts_and_frames(robot, name, seed):
    """Its joints, drawn elsewhere along and about their axes, from another base; others are cut."""
    mechanism, rng = robot(name), np.random.default_rng(seed)
    joints, actuated = joints_of(mechanism)
    order = rng.permutation(len(joints)).tolist()
    size, root = 0.3 * mechanism.length, joints[int(rng.integers(len(joints)))].one
    form = described(joints, root, order, rng, mechanism.length, size)
    assert form.length == pytest.approx(mechanism.length, rel=1e-9)
    expected = mechanism.loop_singular_values(mechanism.q_home)
    assert form.loops(form.q)[: len(expected)] == pytest.approx(expected, abs=1e-9)
    assert form.loops(form.q)[len(expected) :] == pytest.approx(0.0, abs=1e-7)
    expected = passive_singular_values(mechanism, mechanism.q_home)
    assert without(form, actuated)[: len(expected)] == pytest.approx(expected, abs=1e-9)


def joints_of(mechanism: cinegen.Mechanism) -> tuple[list[Joint], list[int]]:
    """A mechanism's joints at home, those that were cut included, and which are actuated."""
    model, kinds = mechanism.model, {"JointModelRZ": LoopKind.REVOLUTE, "JointModelPZ": LoopKind.PRISMATIC}
    data = model.createData()
    pin.framesForwardKinematics(model, data, mechanism.q_home)
    bodies, cut = list(range(model.njoints)), list[Joint]()
    for loop in mechanism.loops:
        first, second = (mechanism.frame_id(node) for node in (loop.first, loop.second))
        ends = [model.frames[frame].parentJoint for frame in (first, second)]
        if loop.kind is LoopKind.RIGID:  # one body
            bodies = [bodies[ends[0]] if body == bodies[ends[1]] else body for body in bodies]
        else:
            cut.append(Joint(loop.kind, *ends, data.oMf[first] * loop.first_placement))
    joints = [
        Joint(kinds[model.joints[j].shortname()], model.parents[j], j, data.oMi[j].copy())
        for j in range(1, model.njoints)
    ]
    joints = [one._replace(one=bodies[one.one], other=bodies[one.other]) for one in joints + cut]
    return joints, [model.getJointId(name) - 1 for name in mechanism.actuated]


def without(form: Form, actuated: list[int]) -> np.ndarray:
    """Singular values of the screw matrix without the columns of some joints."""
    model, loops = form.system.model, form.system.loops
    names = np.repeat(list(model.names), list(model.nvs)).tolist()
    names += np.repeat([loop.name.replace("loop", "joint") for loop in loops], form.system.cut_dof).tolist()
    matrix = LoopScrews(form.system, form.q).matrix(form.system, form.system.evaluate(form.q)[1])
    passive = [column for column, name in enumerate(names) if name not in {f"joint{i}" for i in actuated}]
    return np.linalg.svd(matrix[:, passive], compute_uv=False)
