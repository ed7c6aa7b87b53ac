"""Closed mechanisms as CAD exports them, in URDF and robot.yaml: and Cassie of others, in SDF."""

import sysconfig
import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from coupled_robots import CLOSED_TEXTS
from urdf_text import UrdfJoint, urdf_text
from variants import FEWER

import cinegen
import raff2urdf
from raff2urdf.conversion import convert

CASSIE = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots/cassie_description/robots"

# Both ends of a loop are joints of their own, and at 0 all bars lie along x: the ends are far apart.
FIVE_BAR = [  # joint, parent, child, origin, axis
    ("motor1", "base", "inner1", "-0.15 0 0", "0 0 1"),
    ("elbow1", "inner1", "outer1", "0.25 0 0", "0 0 1"),
    ("end1", "outer1", "end_a", "0.4 0 0", "0 0 1"),
    ("motor2", "base", "inner2", "0.15 0 0", "0 0 1"),
    ("elbow2", "inner2", "outer2", "0.25 0 0", "0 0 1"),
    ("end2", "outer2", "end_b", "0.4 0 0", "0 0 1"),
]
SPATIAL = [  # a crank, a coupler with a ball joint of three axes, a rocker whose axis is askew
    ("crank", "base", "arm", "0 0 0", "0 0 1"),
    ("ball1", "arm", "a", "0.1 0 0", "1 0 0"),
    ("ball2", "a", "b", "0 0 0", "0 1 0"),
    ("ball3", "b", "coupler", "0 0 0", "0 0 1"),
    ("fixed", "coupler", "end_a", "0.5 0 0", None),
    ("rocker", "base", "lever", "0.4 0.1 0", "0.6 0 0.8"),
    ("tip", "lever", "end_b", "-0.3 0 0", None),
]
WRITTEN = {"five_bar": (FIVE_BAR, "6d", ["motor1", "motor2"]), "spatial": (SPATIAL, "3d", ["crank"])}
MODELS = {  # joints (a ball counts as three), loops, freedoms that loops leave to motors, to nothing
    "five_bar": (6, 1, 2, 1),
    "spatial": (5, 1, 1, 1),
    # left and right the same: hip roll, yaw and pitch, knee, shin or its spring, tarsus and foot, less what loops hold
    "cassie_v2": (22, 4, 12, 0),
    "cassie_simple": (27, 4, 11, 0),
}


@pytest.fixture(scope="module")
def file_of(tmp_path_factory):
    """`file_of(case)`: the path of a model."""

    def path(case):
        if case not in WRITTEN:
            return CASSIE / f"{case}.sdf"
        joints, kind, motors = WRITTEN[case]
        folder = tmp_path_factory.mktemp(case)
        kinds = [UrdfJoint(*row[:4], axis=row[4] or "", kind="revolute" if row[4] else "fixed") for row in joints]
        (folder / "robot.urdf").write_text(urdf_text([joint._replace(limit=(-3.2, 3.2)) for joint in kinds], name=case))
        (folder / "robot.yaml").write_text(f"closed_loop: [[end_a, end_b]]\ntype: [{kind}]\nname_mot: {motors}\n")
        return folder / "robot.urdf"

    return path


@pytest.fixture(params=MODELS)
def case(request):
    return request.param


@pytest.fixture(scope="module")
def loaded(file_of):
    """`loaded(case)`: a model, loaded once."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return {case: cinegen.load(file_of(case)) for case in MODELS}.__getitem__


@pytest.fixture
def mechanism(case, loaded, recwarn):
    return loaded(case)


def test_it_closes_at_the_first_try(case, mechanism):
    joints, loops, driven, idle = MODELS[case]
    assert (len(mechanism.joints) + 3 * len(mechanism.balls), len(mechanism.loops)) == (joints, loops)
    assert mechanism.closure(mechanism.q_home) < 1e-12
    left = len(mechanism.structure.passive_columns) - mechanism.structure.passive_rank
    assert (mechanism.mobility - left, left) == (driven, idle)
    assert len(mechanism.actuated) == driven


@pytest.mark.parametrize("case", ["five_bar", "spatial", "cassie_v2"])
def test_it_can_be_said_in_raff(case, mechanism, file_of, tmp_path):
    original = mechanism
    conversion = raff2urdf.to_raff(file_of(case), tmp_path / "it.raff", graphics=False)
    nodes = {link: node for link, node in conversion.nodes.items() if link in original.nodes}
    ours = cinegen.load(tmp_path / "it.raff")
    assert ours.mobility == original.mobility
    assert ours.loop_rank == original.loop_rank
    if case != "cassie_v2":
        assert {conversion.joints[joint] for joint in original.actuated} == set(ours.actuated)
    for q in (original.q_home, *original.random_closed(3)):
        values = {conversion.joints[joint]: q[original.q_index(joint)] for joint in original.joints}
        p = ours.configuration({joint: value + conversion.offsets[joint] for joint, value in values.items()})
        assert ours.closure(p) < 1e-11
        for link, node in nodes.items():
            expected, pose = original.placement(q, link).homogeneous, ours.placement(p, node).homogeneous
            assert np.abs(expected - pose).max() < 1e-9


# --- to simulators and back -------------------------------------------------------------------------------------------
# RAFF -> MJCF or SDF -> `cinegen.load`: the same mobility, the same motion.


ROBOTS = Path(__file__).resolve().parent.parent.parent / "robots"


@pytest.fixture(params=[*sorted(FEWER), *CLOSED_TEXTS])
def original(request, text_file):
    """The RAFF file."""
    if request.param in FEWER:
        return ROBOTS / f"{request.param}.raff"
    return text_file(f"{request.param}.raff", CLOSED_TEXTS[request.param])


@pytest.mark.parametrize("format", ["mjcf", "sdf"])
def test_what_comes_back_is_the_same_mechanism(original, format, tmp_path, recwarn):
    orig = cinegen.load(original)
    (made,) = convert(original, tmp_path / "made", format=format)
    back = cinegen.load(made.file)
    assert back.mobility == orig.mobility
    assert {coupling.name for coupling in back.couplings} == {coupling.name for coupling in orig.couplings}
    assert back.floating == orig.floating
    if not any(loop.kind.name == "PRISMATIC" for loop in orig.loops):
        assert [(loop.name, loop.kind) for loop in back.loops] == [(loop.name, loop.kind) for loop in orig.loops]
    assert set(back.actuated) == set(orig.actuated)
    assert set(orig.joints) <= set(back.joints)
    assert set(orig.nodes) <= set(back.nodes)
    added = set(back.joints) - set(orig.joints)
    assert added or back.length == pytest.approx(orig.length, rel=1e-9)
    assert len(added) == (format == "mjcf") * sum(loop.kind.name == "PRISMATIC" for loop in orig.loops)
    for joint in orig.joints:
        assert back.q_home[back.q_index(joint)] == pytest.approx(orig.q_home[orig.q_index(joint)], abs=1e-9)
        for end in ("lowerPositionLimit", "upperPositionLimit"):
            bound, other = getattr(orig.model, end)[orig.q_index(joint)], getattr(back.model, end)[back.q_index(joint)]
            assert bound == other or bound == pytest.approx(other, abs=1e-9)

    def carried(q, source, target):
        """A configuration of one mechanism in the other."""
        p = target.configuration({joint: q[source.q_index(joint)] for joint in orig.joints})
        if orig.floating:
            base = source.placement(q, "base")
            free = target.placement(target.q_home, "base")
            p = p.copy()
            p[:7] = pin.SE3ToXYZQUAT(pin.XYZQUATToSE3(target.q_home[:7]) * free.inverse() * base)
        return p

    for q in [orig.q_home, *orig.random_closed(4)]:
        p = carried(q, orig, back)
        if added:
            p = back.close(p, locked=orig.joints)
        assert back.closure(p) < 1e-11
        for node in orig.nodes:
            wanted, stands = orig.placement(q, node), back.placement(p, node)
            assert np.abs(wanted.homogeneous - stands.homogeneous).max() < 1e-9
    for p in back.random_closed(4):  # and it can do nothing else
        assert orig.closure(carried(p, back, orig)) < 1e-9
