"""Asks pink and placo for one step of differential inverse kinematics on reference robots, and keeps their answers.

    make .venv-bench/installed
    .venv/bin/python tests/peers/ask_peers.py

They bring a Pinocchio of their own, so they can't stand beside ours in one environment: test_reference_robots.py
compares with what is kept in data/differential_ik.json, and asks again where .venv-bench is there. The problems have
one answer each: as many joints as the task has rows, and a robot that is not singular.
"""

import json
import subprocess
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree

from cinegen.model.urdf import simple
from raff2urdf.readers.urdf import joints
from raff2urdf.readers.urdf_file import parse

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
PYTHON = ROOT / ".venv-bench/bin/python"
SHARE = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"
KEPT = HERE / "data/differential_ik.json"

PROBLEMS = (  # URDF, node, rotations that are held
    ("ur_description/urdf/ur3_robot.urdf", "tool0", 3),
    ("ur_description/urdf/ur5_robot.urdf", "tool0", 3),
    ("ur_description/urdf/ur10_robot.urdf", "tool0", 3),
    ("kinova_description/robots/kinova.urdf", "j2s6s200_link_6", 3),
    ("finger_edu_description/robots/finger_edu.urdf", "finger_tip_link", 0),
    ("solo_description/robots/solo12.urdf", "FL_FOOT", 0),
    ("solo_description/robots/solo12.urdf", "HR_FOOT", 0),
    ("anymal_b_simple_description/robots/anymal.urdf", "LF_FOOT", 0),
    ("a1_description/urdf/a1.urdf", "RR_foot", 0),
    ("go2_description/urdf/go2.urdf", "FL_foot", 0),
    ("hyq_description/robots/hyq_no_sensors.urdf", "rh_foot", 0),
    ("bolt_description/robots/bolt.urdf", "FL_FOOT", 0),
)
LEVELS = (  # URDF, node whose pose is first, node whose position is second, in the freedom that is left
    ("panda_description/urdf/panda.urdf", "panda_hand", "panda_link4"),
    ("baxter_description/urdf/baxter.urdf", "left_hand_link", "left_lower_elbow"),
)
DT, FAR = 1e-3, 1e-5  # s; how far the target is from where the node is (m, rad)


def scene(name: str, node: str, rotation: int, second: str | None = None) -> tuple[dict[str, Any], bytes]:
    """A problem as `benchmarks/peers/worker.py` reads it, and its URDF without shapes."""
    tree = parse((SHARE / name).read_text(encoding="utf-8"), name)
    for link in tree.iter("link"):
        for part in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(part)
    for joint in joints(tree):  # fingers are joints of their own
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
    said = simple(tree, name)
    for joint in joints(tree):  # no limit has a say
        limit = joint.find("limit")
        if limit is not None:
            for word, value in {"lower": "-10", "upper": "10", "velocity": "1000", "effort": "1000"}.items():
                limit.set(word, value)
    text = etree.tostring(tree)
    model = pin.buildModelFromXML(text.decode())
    rng = np.random.default_rng(0)
    data, frame, rows = model.createData(), model.getFrameId(node), 6 if rotation else 3
    best, q = 0.0, pin.neutral(model)
    for _ in range(30):  # far from singular
        trial = rng.uniform(0.3, 1.5, size=model.nq)
        jacobian = pin.computeFrameJacobian(model, data, trial, frame, pin.LOCAL_WORLD_ALIGNED)[:rows]
        least = float(np.linalg.svd(jacobian, compute_uv=False)[rows - 1])
        best, q = max((best, q), (least, trial), key=lambda pair: pair[0])
    home = {entry["name"]: float(q[model.joints[model.getJointId(entry["name"])].idx_q]) for entry in said["joints"]}
    pin.framesForwardKinematics(model, data, q)
    at = data.oMf[frame]
    turn = pin.exp3(FAR * rng.normal(size=3)) if rotation else np.eye(3)
    target = pin.SE3(turn @ at.rotation, at.translation + FAR * rng.normal(size=3))
    unlimited = {"low": -10.0, "high": 10.0, "velocity": None}
    entries = [{"name": joint, "home": value, **unlimited} for joint, value in home.items()]
    problem: dict[str, Any] = {"dt": DT, "gain": 1.0, "node": node, "rotation": rotation, "joints": entries}
    if second is not None:
        point = data.oMf[model.getFrameId(second)].translation + FAR * rng.normal(size=3)
        problem["second"] = {"node": second, "target": point.tolist()}
    return problem | {"loops": [], "targets": [target.homogeneous.tolist()]}, text


def ask(peer: str, problem: dict[str, Any], urdf: bytes) -> list[float]:
    """The joints' values after one step of a peer, in the order of the problem's joints."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.urdf"
        file.write_bytes(urdf)
        described = Path(folder) / "scene.json"
        described.write_text(json.dumps(problem | {"urdf": str(file)}))
        command = [PYTHON, ROOT / f"benchmarks/peers/{peer}_.py", described]
        answer = subprocess.check_output(command, input='{"steps": 1}\n', text=True)
    values: list[float] = json.loads(answer.splitlines()[1])["q"][0]
    return values


def main() -> None:
    answers: list[dict[str, Any]] = []
    for name, node, rotation in PROBLEMS:
        problem, urdf = scene(name, node, rotation)
        replies = {peer: ask(peer, problem, urdf) for peer in ("pink", "placo")}
        answers.append({"urdf": name, "node": node, "rotation": rotation, **replies})
        print(name, node)
    for name, node, second in LEVELS:
        replies = {"placo": ask("placo", *scene(name, node, 3, second))}
        answers.append({"urdf": name, "node": node, "rotation": 3, "second": second, **replies})
        print(name, node, second)
    KEPT.write_text(json.dumps(answers, indent=1) + "\n")


if __name__ == "__main__":
    main()
