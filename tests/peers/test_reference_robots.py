"""URDF -> RAFF -> URDF -> Pinocchio, on every robot of example-robot-data: the same placements and Jacobians.

All of its URDFs are in, but for those in OUT.
"""

from __future__ import annotations

import sysconfig
import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree
from variants import slow

import raff2urdf
from cinegen.model.urdf import simple
from raff2urdf import readers
from raff2urdf.conversion import translate
from raff2urdf.readers.urdf import joints, parse
from raff2urdf.urdf2raff.robot import import_tree

SHARE = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"

OUT = {
    "hector_description/robots/quadrotor_base.urdf": "one rigid body: nothing moves",
    "iris_description/robots/iris_simple.urdf": "one rigid body: nothing moves",
    "ur_description/urdf/ur3.urdf": "a xacro file that only includes others: no robot",
}

WRONG = {"alex_description/urdf/alex_psyonic_hands.urdf": "its fingers mimic joints that it lacks, such as index_q1"}

EVERY = sorted(path.relative_to(SHARE).as_posix() for path in SHARE.rglob("*.urdf"))
IN = [name for name in EVERY if name not in OUT]

OF_EACH_KIND = {
    *("asr_twodof_description/urdf/TwoDofs.urdf", "double_pendulum_description/urdf/double_pendulum_continuous.urdf"),
    *(
        "kinova_description/robots/kinova.urdf",
        "ur_description/urdf/ur5_robot.urdf",
        "xarm_description/urdf/xarm7.urdf",
    ),
    *("panda_description/urdf/panda.urdf", "talos_data/robots/talos_left_arm.urdf"),  # mimic joints, sound and
    "alex_description/urdf/alex_psyonic_hands.urdf",  # wrong
    "allegro_hand_description/urdf/allegro_left_hand.urdf",
    *("a1_description/urdf/a1.urdf", "hyq_description/robots/hyq_no_sensors.urdf"),  # a floating base
    *("anymal_b_simple_description/robots/anymal-kinova.urdf", "solo_description/robots/solo12.urdf"),
    *("human_description/robots/human.urdf", "simple_humanoid_description/urdf/simple_humanoid.urdf"),
    *("borinot_description/urdf/borinot_flying_arm_2.urdf", "iris_description/robots/iris_simple.urdf"),
    *("baxter_description/urdf/baxter.urdf", "tiago_description/robots/tiago_no_hand.urdf"),
    "pr2_description/urdf/pr2.urdf",  # loops
}


def others_slow(names):
    return [name if name in OF_EACH_KIND else slow(name)[0] for name in names]


EXACT = 1e-9  # m, rad, and what Jacobians hold
SAMPLES = 100


@pytest.fixture(autouse=True)
def _quiet(recwarn):
    """What these files leave out is told elsewhere."""


def model_of(text):
    tree = parse(text, "x")
    simple(tree, "x")
    return pin.buildModelFromXML(etree.tostring(tree, encoding="unicode"))


def frames_of(model):
    return {frame.name: i for i, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY}


def evaluate(model, q):
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    return data


def jacobian(model, data, frame, columns):
    return np.asarray(pin.getFrameJacobian(model, data, frame, pin.LOCAL)).reshape(6, model.nv)[:, columns]


def constraints_of(name):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the PR2's grippers
        return readers.read(SHARE / name, ignore=["mimic"] if name in WRONG else []).constraints


def test_at_least_thirty_robots_are_in():
    assert len(IN) >= 60
    assert set(EVERY) > OF_EACH_KIND
    assert set(OUT) <= set(EVERY)


@pytest.mark.parametrize("name", others_slow(IN))
def test_placements_and_jacobians_are_those_of_the_original(name):
    text = (SHARE / name).read_text(encoding="utf-8")
    tree = parse(text, name)
    found = import_tree(tree, name, constraints_of(name))
    followers = [one for one in joints(tree) if one.find("mimic") is not None and one.get("type") != "fixed"]
    assert len(found.document.robot().couplings) == (0 if name in WRONG else len(followers))
    document = raff2urdf.loads(raff2urdf.dumps(found.document))
    assert document == found.document
    raff2urdf.check(document)
    original = model_of(text)
    ours = model_of(translate(document, document.robot(), Path()).urdf)
    assert ours.nv == original.nv == len(found.joints)
    pairs = [
        (original.joints[original.getJointId(own)], ours.joints[ours.getJointId(theirs)], found.offsets[theirs])
        for own, theirs in found.joints.items()
    ]
    own_columns, our_columns = [own.idx_v for own, _, _ in pairs], [our.idx_v for _, our, _ in pairs]
    own_frames, our_frames = frames_of(original), frames_of(ours)
    assert set(own_frames) - set(found.nodes) <= {"world"}  # the world is where it was
    rng = np.random.default_rng(0)
    for _ in range(SAMPLES):
        q, p = pin.neutral(original), pin.neutral(ours)
        for own, our, offset in pairs:
            q[own.idx_q] = rng.uniform(-np.pi, np.pi)
            p[our.idx_q] = q[own.idx_q] + offset
        data, there = evaluate(original, q), evaluate(ours, p)
        for link, node in found.nodes.items():
            i, j = own_frames[link], our_frames[node]
            assert np.abs(data.oMf[i].homogeneous - there.oMf[j].homogeneous).max() < EXACT
            difference = jacobian(original, data, i, own_columns) - jacobian(ours, there, j, our_columns)
            assert np.abs(difference).max() < EXACT


@pytest.mark.parametrize("name", others_slow(IN))
def test_written_again_it_is_the_same(name):
    """URDF -> RAFF -> URDF -> RAFF -> URDF: a fixed point."""
    found = import_tree(parse((SHARE / name).read_text(encoding="utf-8"), name), name, constraints_of(name))
    made = translate(found.document, found.document.robot(), Path())
    second = import_tree(parse(made.urdf, name), name, made.constraints)
    again = translate(second.document, second.document.robot(), Path())
    third = import_tree(parse(again.urdf, name), name, again.constraints)
    assert third.document == second.document
    assert set(second.offsets.values()) == {0.0}
    assert len(second.document.robot().links) == len(found.document.robot().links)


@pytest.mark.parametrize("name", others_slow(name for name in EVERY if name != "ur_description/urdf/ur3.urdf"))
def test_no_robot_is_suspected_of_a_loop(name, recwarn):
    """Only the PR2 has loops, in its grippers, as Gazebo before SDF read them: it loads as a tree, with a warning."""
    if name in WRONG:
        with pytest.raises(raff2urdf.RaffError, match=r"<mimic> in joint 'Left_index_q2' names joint 'index_q1'"):
            readers.read(SHARE / name)
        return
    readers.read(SHARE / name)
    warned = [str(warning.message) for warning in recwarn]
    if name == "pr2_description/urdf/pr2.urdf":
        (message,) = warned
        assert "<joint:hinge> 'r_gripper_r_parallel_tip_joint' in <gazebo>" in message
    else:
        assert not warned
