"""Maps of reactions, stiffness and frequencies: closed forms, and single configurations."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from mapped import over
from urdf_text import UrdfJoint, urdf_text

import cinegen
from cinegen.design import tolerance
from cinegen.dynamics.errors import MassError
from cinegen.errors import UnknownNameError
from cinegen.workspace import QUANTITIES, MapError, MapSpecification, make_map, open_map
from cinegen.workspace.evaluator import ChunkEvaluator

UPPER, FORE, MASSES, EFFORTS, G = 0.5, 0.3, (2.0, 1.0), (30.0, 15.0), 9.81
SPRINGS = {"shoulder": 400.0, "elbow": 150.0}


@pytest.fixture(scope="module")
def arm():
    """Two bars in the plane of x and z with point masses at their ends."""
    body = """<inertial><origin xyz="{} 0 0"/><mass value="{}"/>
      <inertia ixx="1e-12" iyy="1e-12" izz="1e-12" ixy="0" ixz="0" iyz="0"/></inertial>"""
    joints = [
        UrdfJoint("shoulder", "base", "upper", "0 0 0", "0 -1 0", effort=EFFORTS[0]),
        UrdfJoint("elbow", "upper", "fore", f"{UPPER} 0 0", "0 -1 0", effort=EFFORTS[1]),
        UrdfJoint("end", "fore", "tip", f"{FORE} 0 0", kind="fixed"),
    ]
    links = {"upper": body.format(UPPER, MASSES[0]), "fore": body.format(FORE, MASSES[1])}
    return cinegen.load(urdf_text(joints, links, "upright"))


def cells(spec):
    """Each reachable cell: its configuration, and its exact values by quantity."""
    made = ChunkEvaluator(spec)._by.cells(tuple(slice(0, count) for count in spec.region.shape))
    values = {name: QUANTITIES[name].values(made) for name in spec.quantities}
    known = np.isfinite(made.evaluations.q).all(axis=1)
    assert known.sum() > 1
    return [(q, {name: data[k] for name, data in values.items()}) for k, q in enumerate(made.evaluations.q) if known[k]]


def lever(q):
    """(2, 2) motion of the tip along x and z by the joints."""
    both = q[0] + q[1]
    return np.array([
        [-UPPER * math.sin(q[0]) - FORE * math.sin(both), -FORE * math.sin(both)],
        [UPPER * math.cos(q[0]) + FORE * math.cos(both), FORE * math.cos(both)],
    ])  # fmt: skip


def inertia(q, tip=0.0):
    """(2, 2) mass matrix, with a mass at the tip besides."""
    first = UPPER * np.array([[-math.sin(q[0]), 0.0], [math.cos(q[0]), 0.0]])
    return MASSES[0] * first.T @ first + (MASSES[1] + tip) * lever(q).T @ lever(q)


@pytest.mark.parametrize("tip", [0.0, 1.5])
def test_an_arm_of_two_bars(arm, tip):
    names = ("reaction_force", "reaction_moment", "stiffness", "rotational_stiffness", "frequency")
    region = over(("x", 0.1, 0.8, 6), ("z", -0.5, 0.7, 6))
    payloads = {"tip": tip} if tip else {}
    for joint, hangs in (("shoulder", MASSES[0] + MASSES[1] + tip), ("elbow", MASSES[1] + tip)):
        spec = MapSpecification(arm, region, names, "tip", payloads=payloads, reaction=joint, stiffness=SPRINGS)
        for q, values in cells(spec):
            elbow, hand = UPPER * math.cos(q[0]), UPPER * math.cos(q[0]) + FORE * math.cos(q[0] + q[1])
            moment = (MASSES[1] + tip) * (hand - elbow)
            if joint == "shoulder":
                moment = MASSES[0] * elbow + (MASSES[1] + tip) * hand
            assert values["reaction_force"] == pytest.approx(G * hangs, rel=1e-9)
            assert values["reaction_moment"] == pytest.approx(G * abs(moment), rel=1e-6)
            compliance = lever(q) @ np.diag([1.0 / k for k in SPRINGS.values()]) @ lever(q).T
            assert values["stiffness"] == pytest.approx(1.0 / np.linalg.eigvalsh(compliance)[-1], rel=1e-9)
            assert values["rotational_stiffness"] == pytest.approx(1.0 / (1.0 / 400.0 + 1.0 / 150.0), rel=1e-9)
            softness = np.linalg.eigvals(np.diag([1.0 / k for k in SPRINGS.values()]) @ inertia(q, tip))
            wanted = 1.0 / (2.0 * math.pi * math.sqrt(softness.real.max()))
            assert values["frequency"] == pytest.approx(wanted, rel=1e-6)


def test_an_upright_arm_holds_what_statics_gives_it(arm):
    region, limits = over(("x", -0.8, 0.8, 15), ("z", -0.8, 0.8, 15)), np.array(EFFORTS)
    for q, values in cells(MapSpecification(arm, region, ("torque", "payload"), "tip")):
        arms, upper = G * lever(q)[1], G * UPPER * math.cos(q[0])
        weight = MASSES[1] * arms + MASSES[0] * np.array([upper, 0.0])
        assert values["torque"] == pytest.approx(np.abs(weight / limits).max(), rel=1e-5)
        most = min((limits[i] - np.sign(arms[i]) * weight[i]) / abs(arms[i]) for i in range(2) if arms[i])
        assert values["payload"] == pytest.approx(most, rel=1e-4)
    weak = cinegen.load(re.sub('effort="[^"]*"', 'effort="0"', arm.source.urdf))
    with pytest.raises(cinegen.CinegenError, match="no actuated joint has a limit of torque or force"):
        MapSpecification(weak, region, ("payload",), "tip")


@pytest.mark.parametrize("push", [0.0, 20.0])
def test_the_payload_in_any_direction_of_gravity_is_that_of_the_worst(arm, push):
    """Against the payloads in many directions, of which none is less, and the worst hardly more."""
    region = over(("x", 0.3, 0.7, 2), ("z", -0.3, 0.4, 2))
    wrenches = {"tip": (push, 0.0, -0.5 * push, 0.0, 0.0, 0.0)} if push else {}
    angles = np.linspace(0.0, 2.0 * math.pi, 2001)
    down = G * np.array([np.sin(angles), np.cos(angles)])  # along y the axes bear it
    for q, values in cells(MapSpecification(arm, region, ("payload_any",), "tip", wrenches=wrenches)):
        first = UPPER * np.array([[-math.sin(q[0]), 0.0], [math.cos(q[0]), 0.0]])
        weight = (MASSES[0] * first + MASSES[1] * lever(q)).T @ down + (lever(q).T @ [push, -0.5 * push])[:, None]
        by_mass = lever(q).T @ down
        most = np.min((np.array(EFFORTS)[:, None] - np.sign(by_mass) * weight) / np.abs(by_mass))
        assert most * (1.0 - 1e-4) <= values["payload_any"] <= most * (1.0 + 1e-9)


LIFT = """
robot lift {
  base { }
  link 1 { parameters { theta 40 } type 2 pred 0 limits { 5 85 } actuated 1 }
  link 2 { parameters { gamma 90 alpha 90 r 306.418 } type 1 pred 0 actuated 0 }
  link 3 { parameters { alpha -90 theta 50 } type 2 pred 2 actuated 0 }
  frame 4 { parameters { d 200 } pred 1 }
  frame 5 { parameters { d 200 } pred 3 }
  constraint { frame 4 frame 5 type 2 }
  frame 6 { name "corner" parameters { d 400 } pred 1 }
}
"""


def test_a_spring_at_the_foot_of_a_scissor_lift(raff):
    """The foot is at 0.4 cos(angle), the corner rotates with the bar: springs of a passive joint count."""
    lift = raff(LIFT)
    stiffness = {"joint1": 50.0, "joint2": 3000.0}
    spec = MapSpecification(lift, over(("joint1", 0.2, 1.3, 6)), ("stiffness",), stiffness=stiffness)
    for q, values in cells(spec):
        wanted = (50.0 + 3000.0 * (0.4 * math.sin(q[0])) ** 2) / 0.4**2
        assert values["stiffness"] == pytest.approx(wanted, rel=1e-8)
    alone = MapSpecification(lift, over(("joint1", 0.2, 1.3, 6)), ("stiffness",), stiffness={"joint1": 50.0})
    for _, values in cells(alone):
        assert values["stiffness"] == pytest.approx(50.0 / 0.4**2, rel=1e-9)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"quantities": ("reaction_force",)}, MapError, "reaction_force is that of one joint or loop: name it"),
        ({"quantities": ("reaction_force",), "reaction": "elbo"}, UnknownNameError, "did you mean 'elbow'"),
        ({"quantities": ("frequency",)}, MapError, "stiffness and frequency take the stiffness of joints"),
        ({"quantities": ("stiffness",), "stiffness": {"elbow": -1.0}}, MapError, "must be positive and finite, not -1"),
        ({"quantities": ("sigma_1",), "payloads": {"tip": 1.0}}, MapError, "payloads: no quantity of this map takes"),
        ({"quantities": ("stiffness",), "stiffness": SPRINGS, "wrenches": {"tip": [0] * 6}}, MapError, "wrenches: no"),
    ],
)
def test_wrong_settings(arm, options, error, message):
    with pytest.raises(error, match=re.escape(message)):
        MapSpecification(arm, over(("x", 0.1, 0.8, 4)), node="tip", **options)


def test_what_can_not_be_mapped_is_refused(robot):
    planar, region = robot("planar_3r"), over(("x", 0.1, 0.8, 4))
    springs = dict.fromkeys(planar.actuated, 1e3)
    takes = {"frequency": {"stiffness": springs}, "reaction_force": {"reaction": "joint2"}, "torque": {}}
    for name, more in takes.items():
        with pytest.raises(MassError, match="have no mass"):
            MapSpecification(planar, region, (name,), **more)
    MapSpecification(planar, region, ("stiffness",), stiffness=springs)
    free = MapSpecification(planar, region, ("reaction_force",), reaction="joint2", gravity=(0, 0, 0),
                            wrenches={"tool": (3, 4, 0, 0, 0, 0)})  # fmt: skip
    for _, values in cells(free):
        assert values["reaction_force"] == pytest.approx(5.0)


# --- map accuracy -----------------------------------------------------------------------------------------------------
# Maps of the accuracy: single configurations, and what they take.


ROBOTS = Path(__file__).parents[2] / "robots"
SIGMA = {"link*.d": "0.1mm", "tool.d": "0.1mm"}
GIVEN = {"raff": (ROBOTS / "five_bar.raff").read_text(), "sigma": SIGMA, "encoder": {"joint1": "0.01deg"}}
REGION = over(("x", -0.2, 0.2, 4), ("y", 0.3, 0.6, 3))


def test_each_cell_has_the_accuracy_of_its_configuration(tmp_path):
    five_bar = cinegen.load("five_bar")
    spec = MapSpecification(five_bar, REGION, ("accuracy",), tolerances=GIVEN)
    dataset = make_map(spec, tmp_path / "map.zarr", workers=1)
    values, joints = dataset.accuracy.values.ravel(), dataset.configuration.values.reshape(-1, len(five_bar.joints))
    known = np.flatnonzero(np.isfinite(values))
    assert len(known) >= 6
    for i in known:
        q = five_bar.configuration(dict(zip(dataset.joint.values.tolist(), joints[i].tolist(), strict=True)))
        accuracy = tolerance("five_bar", SIGMA, encoder={"joint1": "0.01deg"}, q=q)
        np.testing.assert_allclose(values[i], accuracy.position, rtol=1e-5)  # maps are stored as float32
    dataset.close()
    assert open_map(tmp_path / "map.zarr").accuracy.attrs["units"] == "m"


@pytest.mark.parametrize(
    ("quantities", "tolerances", "message"),
    [
        (("accuracy",), {}, "accuracy takes tolerances: give them"),
        (("sigma_1",), GIVEN, "no quantity of this map takes them"),
        (("accuracy",), {"sigma": SIGMA}, "tolerances have the keys raff"),
        (("accuracy",), {**GIVEN, "raff": GIVEN["raff"].replace("actuated 1", "actuated 0", 1)}, "is not as its RAFF"),
    ],
)
def test_what_does_not_fit_is_refused(quantities, tolerances, message):
    with pytest.raises(MapError, match=message):
        MapSpecification(cinegen.load("five_bar"), REGION, quantities, tolerances=tolerances)


def test_the_command(tmp_path, monkeypatch, typed):
    monkeypatch.chdir(tmp_path)
    words = ["map", "five_bar", "--over", "x=-0.1..0.1:2,y=0.4..0.5:2", "--workers", "1"]
    assert "accuracy" in typed(*words, "--sigma", "link*.d=0.1mm", "--play", "joint2=0.02mm", "-o", "a.zarr").out
    said = typed(*words, "--sigma", "link*.d=0.1mm", "--vary", "link2.d=0.2..0.3:2", "-o", "b", code=2)
    assert "exclude each other" in said.err
