"""Accelerations of joints that brake before limits of position, next to others that take longer."""

import sysconfig
from pathlib import Path

import numpy as np
import pinocchio as pin

import cinegen
from cinegen.collision import clearance_of, scene_of
from cinegen.model.motion_limits import motion_limits
from cinegen.planning import AvoidingSolver

DT = 1 / 240
READY = 0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785, 0.02
OBSTACLES = [
    {"name": "table", "kind": "box", "size": [2.0, 2.0, 0.1], "point": [0.0, 0.0, -0.1]},
    {"name": "wall", "kind": "box", "size": [0.1, 1.0, 1.0], "point": [0.75, 0.0, 0.3]},
    {"name": "left", "kind": "sphere", "radius": 0.15, "point": [0.45, 0.45, 0.4]},
    {"name": "right", "kind": "sphere", "radius": 0.15, "point": [0.45, -0.45, 0.4]},
]


def test_an_arm_whose_fingers_are_coupled_obeys_its_limits():
    """Targets of the hand and of a finger jump, among obstacles: steps are refused, joints at their limits. The fingers
    brake together, but not as long as the arm, whose joints brake alone."""
    robots = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"
    panda = cinegen.load(robots / "panda_description/urdf/panda.urdf")
    start = {"joints": dict(zip(panda.actuated, READY, strict=True))}
    given = {"safety": 0.01, "start": start, "goal": {"point": [0.0, 0.0, 0.0]}, "obstacle": OBSTACLES}
    scene = scene_of(given, mechanism=panda)
    solver, rng = AvoidingSolver(clearance_of(scene), DT, 0.01, q=scene.start), np.random.default_rng(0)
    hand = solver.add_task("panda_hand", rotation=0, axes="world")
    finger = solver.add_task("panda_leftfinger", rotation=0, axes="world")
    home, q = hand.target.translation.copy(), [solver.q]
    for tick in range(320):
        if tick % 40 == 0:
            aim, open_by = home + rng.uniform(-0.5, 0.5, 3), rng.choice([-0.05, 0.1])
        held, at = panda.placement(solver.q, "panda_hand"), panda.placement(solver.q, "panda_leftfinger")
        hand.target = pin.SE3(hand.target.rotation, aim)
        finger.target = pin.SE3(at.rotation, held.act(np.array([0.0, open_by, 0.0584])))
        q.append(solver.step().q)
    moved = np.array(q)
    changes = np.diff(np.vstack([moved[:1], moved]), n=2, axis=0) / DT**2
    limits = motion_limits(panda).acceleration
    limits[panda.v_index("panda_finger_joint2")] = limits[panda.v_index("panda_finger_joint1")]  # it is coupled to it
    assert (np.abs(changes) <= limits * (1.0 + 1e-6)).all()
    assert np.ptp(moved[:, -1]) > 0.03
