"""The scenes of `compare.py`: robot, targets, rate, gain and limits, written to files that every library reads.

A scene is `<name>.json`, beside the URDF it names (and the URDF's constraints, where there are loops). The URDF is
stripped of shapes and masses: all libraries then have the same joints, and nobody loads meshes.

    panda     7 joints, a pose for its hand: one joint more than needed
    ur5       6 joints, a pose for its flange
    four_bar  3 joints, 1 loop (revolute), mobility 1: a place for a point of the coupler
    delta     15 joints, 2 loops (rigid), mobility 3: a place for the platform
"""

from __future__ import annotations

import json
import math
import shutil
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from bench import EXAMPLES, PANDA

import cinegen
import raff2urdf

DT = 1e-3  # s: 1 kHz
GAIN = 1.0  # the whole error is to be made good in a step
TARGETS = 1000  # a closed path: the last target is the start

GENERATED = Path(__file__).parent.parent / "generated"

FOUR_BAR = """RAFF FourBar
robot linkage {
  base { }
  link 1 { parameters { theta 50 } type 2 pred 0 limits { -360 360 } velocity 720 actuated 1 }
  link 2 { parameters { theta -25.722522 d 120 } type 2 pred 1 limits { -360 360 } velocity 720 }
  link 3 { parameters { theta 88.735117 d 400 } type 2 pred 0 limits { 60 170 } velocity 720 }
  frame 4 { parameters { d 360 } pred 2 }
  frame 5 { parameters { d 240 } pred 3 }
  frame 20 { name "tool" parameters { d 220 gamma 40 } pred 2 }
  constraint { frame 4 frame 5 type 2 }
}
"""


def panda(folder: Path) -> Path:
    urdf = _stripped(PANDA, folder / "panda.urdf", fixed="finger")
    home = [0.0, -math.pi / 4, 0.0, -3 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4]
    home_of = {f"panda_joint{i + 1}": value for i, value in enumerate(home)}
    return _scene(urdf, "panda_hand", 3, home_of, lambda at: _eight(at, (0.02, 0.07, 0.03), 0.1))


def ur5(folder: Path) -> Path:
    urdf = _stripped(EXAMPLES / "ur_description/urdf/ur5_joint_limited_robot.urdf", folder / "ur5.urdf")
    home_of = {
        "shoulder_pan_joint": 0.3,
        "shoulder_lift_joint": -1.2,
        "elbow_joint": 1.6,
        "wrist_1_joint": -2.0,
        "wrist_2_joint": -1.5,
        "wrist_3_joint": 0.3,
    }
    return _scene(urdf, "tool0", 3, home_of, lambda at: _eight(at, (0.02, 0.07, 0.03), 0.1))


def four_bar(folder: Path) -> Path:
    text = folder / "four_bar.raff"
    text.write_text(FOUR_BAR)
    (made,) = raff2urdf.convert(text, folder)
    return _scene(_stripped(made.urdf, made.urdf), "tool", 0, {}, lambda at: {"joint1": 1.2 * math.sin(math.tau * at)})


def delta(folder: Path) -> Path:
    urdf = _stripped(GENERATED / "delta4.urdf", folder / "delta4.urdf")
    shutil.copy(GENERATED / "delta4.constraints.json", folder)
    return _scene(urdf, "platform", 0, {}, lambda at: _eight(at, (0.1, 0.2, 0.1), 0.0))


SCENES: dict[str, Callable[[Path], Path]] = {"panda": panda, "ur5": ur5, "four_bar": four_bar, "delta": delta}


def _eight(at: float, size: tuple[float, float, float], tilt: float) -> pin.SE3:
    """A figure-eight from `at` = 0 to 1, as a displacement in the world; it also tilts (rad)."""
    once, twice = math.sin(math.tau * at), math.sin(2.0 * math.tau * at)
    turn = pin.exp3(tilt * np.array([once, twice, 0.5 * once]))
    return pin.SE3(turn, np.array([size[0] * twice, size[1] * once, size[2] * twice]))


def _scene(
    urdf: Path, node: str, rotation: int, home_of: dict[str, float], path: Callable[[float], pin.SE3 | dict[str, float]]
) -> Path:
    """Writes a scene.

    Args:
        urdf: the robot.
        node: which follows the targets.
        rotation: 3 if its orientation is held too, else 0.
        home_of: where joints begin; the others as in the file.
        path: from 0 to 1: displacements from home in the world, or how far joints move on from home (the other
            joints then close the loops).
    """
    mechanism = cinegen.load(urdf)
    home = mechanism.configuration(home_of) if home_of else mechanism.q_home
    start = mechanism.placement(home, node)
    targets, q = [], home
    for k in range(1, TARGETS + 1):
        move = path(k / TARGETS)
        if isinstance(move, pin.SE3):
            target = pin.SE3(move.rotation @ start.rotation, start.translation + move.translation)
        else:
            moved = {joint: float(home[mechanism.q_index(joint)]) + by for joint, by in move.items()}
            q = mechanism.close(mechanism.configuration(moved, q), locked=tuple(moved))
            target = mechanism.placement(q, node)
        targets.append(target.homogeneous.tolist())
    scene: dict[str, Any] = {
        "urdf": str(urdf),
        "dt": DT,
        "gain": GAIN,
        "node": node,
        "rotation": rotation,
        "joints": [_joint(mechanism, name, home) for name in mechanism.joints],
        "loops": [_loop(loop) for loop in mechanism.loops],
        "targets": targets,
    }
    file = urdf.with_suffix(".json")
    file.write_text(json.dumps(scene))
    return file


def _joint(mechanism: cinegen.Mechanism, name: str, home: np.ndarray) -> dict[str, Any]:
    """Name, home, limits; `velocity` is None where there is no limit of speed."""
    model, i, k = mechanism.model, mechanism.q_index(name), mechanism.v_index(name)
    fastest = float(model.upperVelocityLimit[k])
    return {
        "name": name,
        "home": float(home[i]),
        "low": float(model.lowerPositionLimit[i]),
        "high": float(model.upperPositionLimit[i]),
        "velocity": fastest if 0.0 < fastest < 1e8 else None,
    }


def _loop(loop: Any) -> dict[str, str]:
    """The two links whose frames coincide, up to a turn about z where the kind is revolute."""
    assert loop.first_placement.isIdentity()
    assert loop.second_placement.isIdentity()
    return {"first": loop.first, "second": loop.second, "kind": loop.kind.name.lower()}


def _stripped(source: Path, urdf: Path, fixed: str = "-") -> Path:
    """Writes a URDF again without shapes and masses; joints with `fixed` in their names no longer move."""
    tree = ElementTree.parse(source)
    root = tree.getroot()
    for tag in ("gazebo", "transmission", "material"):
        for element in root.findall(tag):
            root.remove(element)
    for link in root.findall("link"):
        for tag in ("visual", "collision", "inertial"):
            for element in link.findall(tag):
                link.remove(element)
    for joint in root.findall("joint"):
        if fixed in joint.get("name", ""):
            joint.set("type", "fixed")
            for tag in ("axis", "limit", "mimic"):
                for element in joint.findall(tag):
                    joint.remove(element)
    tree.write(urdf)
    return urdf
