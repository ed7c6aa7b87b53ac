"""A solver in JavaScript of serial arms, for tests of the page: forward kinematics, and damped least squares of finite
differences, without limits of velocity. It stands where the module of `cinegen generate --to js` stands."""

from __future__ import annotations

import json
from pathlib import Path

import pinocchio as pin

TEXT = (Path(__file__).parents[1] / "javascript" / "serial_solver.js").read_text(encoding="utf-8")


def serial_solver(mechanism):
    """The module of a robot without loops whose joints are revolute or prismatic."""
    model = mechanism.model
    joints = [
        {
            "parent": model.parents[i] - 1,
            "placement": pin.SE3ToXYZQUAT(model.jointPlacements[i]).tolist(),
            "axis": model.joints[i].shortname()[-1].lower(),
            "prismatic": "P" in model.joints[i].shortname().replace("JointModel", ""),
        }
        for i in range(1, model.njoints)
    ]
    frames = [model.frames[mechanism.frame_id(node)] for node in mechanism.nodes]
    nodes = [{"joint": f.parentJoint - 1, "placement": pin.SE3ToXYZQUAT(f.placement).tolist()} for f in frames]
    limits = mechanism.limits
    table = {
        "joints": joints, "nodes": nodes, "names": {"joints": list(model.names)[1:], "nodes": list(mechanism.nodes)},
        "home": mechanism.q_home.tolist(), "length": mechanism.length,
        "lower": [max(x, -1e9) for x in limits.lower], "upper": [min(x, 1e9) for x in limits.upper],
    }  # fmt: skip
    return TEXT.replace("const TABLE = {};", f"const TABLE = {json.dumps(table)};")
