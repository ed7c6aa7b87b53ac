"""Ticks of the generated JavaScript of a delta robot beside closed-chain-ik's, in one process of node.

    python benchmarks/closed_chain_ik.py [TICKS]

Both follow the same targets of the platform, without limits being met. closed-chain-ik solves with its defaults, which
leave a target alone that is nearer than 1 mm; to 1e-6 (m and rad) in at most 5 iterations; with one of these a tick;
and with no threshold, in as many iterations a tick as are named: so it is seen how far it closes loops, and how soon.
Times are of the processor. Loops are judged by Pinocchio's kinematics in Python, at configurations that both wrote.
Needs node, npm and the network: closed-chain-ik is installed into a temporary folder.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin

import cinegen
from cinegen.codegen import Function, Language, generate

PACKAGE = "closed-chain-ik@0.0.3"
NODE = """
import create from "./robot.mjs";
import { readFileSync, writeFileSync } from "node:fs";
import { DOF, Goal, Joint, Link, Solver } from "closed-chain-ik/src/core/index.js";

const { joints, ends, loops, platform, begin, ticks } = JSON.parse(readFileSync("delta.json", "utf8"));
const target = (i) => [begin[0] + 0.3 * Math.sin(i * 2e-3), begin[1] + 0.3 * Math.sin(i * 1.3e-3), begin[2]];

function run(follow, q) {
  const found = [], spans = [], batch = 100;
  for (let i = 0; i < ticks; i += batch) {
    const start = process.cpuUsage(); // a busy machine does not lengthen it
    for (let k = 1; k <= batch; k += 1) follow(target(i + k));
    spans.push(process.cpuUsage(start).user / batch);
    found.push({ target: target(i + batch), q: q() });
  }
  spans.sort((a, b) => a - b);
  return { us: spans[spans.length >> 1], found };
}

function place(frame, [position, quaternion]) {
  frame.setPosition(...position);
  frame.setQuaternion(...quaternion);
  return frame;
}

/** A frame on a link, by a joint that does not move. */
function mounted(link, placement, what) {
  const joint = place(new Joint(), placement);
  link.addChild(joint);
  joint.addChild(what);
  return what;
}

function theirs(settings) {
  const links = [new Link()], moving = [];
  for (const { parent, placement } of joints) {
    const joint = place(new Joint(), placement), link = new Link();
    joint.setDoF(DOF.EZ);
    joint.addChild(link);
    links[parent].addChild(joint);
    links.push(link);
    moving.push(joint);
  }
  for (const [first, second] of loops) {
    const joint = place(new Joint(), first.placement);
    links[first.joint].addChild(joint);
    joint.makeClosure(mounted(links[second.joint], second.placement, new Link()));
  }
  const goal = new Goal(), end = mounted(links[platform.joint], platform.placement, new Link());
  goal.setGoalDoF(DOF.X, DOF.Y, DOF.Z);
  goal.makeClosure(end);
  const solver = Object.assign(new Solver([links[0], goal]), settings);
  return run((to) => { goal.setPosition(...to); solver.solve(); }, () => moving.map((one) => one.dofValues[DOF.EZ]));
}

function ours() {
  const robot = create();
  return run((to) => { robot.targets[0].set(to, 9); robot.tick(); }, () => [...robot.q]);
}

const precise = { translationConvergeThreshold: 1e-6, rotationConvergeThreshold: 1e-6, stallThreshold: 1e-7 };
const exact = { translationConvergeThreshold: 0, rotationConvergeThreshold: 0, stallThreshold: 0 };
writeFileSync("found.json", JSON.stringify({
  "cinegen": ours(),
  "closed-chain-ik": theirs({}),
  "closed-chain-ik, to 1e-6": theirs(precise),
  "closed-chain-ik, 1 iteration": theirs({ ...precise, maxIterations: 1 }),
  ...Object.fromEntries([2, 3, 5, 10, 30].map((count) => [
    `closed-chain-ik, ${count} iterations`,
    theirs({ ...exact, maxIterations: count }),
  ])),
}));
"""


def written(placement: pin.SE3) -> list[list[float]]:
    """Return the position and the quaternion (x, y, z, w) of a placement."""
    return [placement.translation.tolist(), pin.Quaternion(placement.rotation).coeffs().tolist()]


def carried(mechanism: cinegen.Mechanism, node: str, placement: pin.SE3) -> dict[str, object]:
    """Return the joint that carries a placement on a node, and the placement relative to the joint."""
    frame = mechanism.model.frames[mechanism.frame_id(node)]
    return {"joint": frame.parentJoint, "placement": written(frame.placement * placement)}


def description(mechanism: cinegen.Mechanism, ticks: int) -> dict[str, object]:
    """Return joints, loops and platform of a mechanism whose joints are revolute about z at q = 0, as JSON has them.

    The first placement of each joint includes its value at home, so that both begin at home.
    """
    model = mechanism.model
    assert set(joint.shortname() for joint in list(model.joints)[1:]) == {"JointModelRZ"}
    home = [model.joints[i].createData() for i in range(model.njoints)]
    for i in range(1, model.njoints):
        model.joints[i].calc(home[i], mechanism.q_home)
    loops = [
        [carried(mechanism, loop.first, loop.first_placement), carried(mechanism, loop.second, loop.second_placement)]
        for loop in mechanism.loops
    ]
    return {
        "joints": [
            {"parent": int(model.parents[i]), "placement": written(model.jointPlacements[i] * home[i].M)}
            for i in range(1, model.njoints)
        ],
        "loops": loops,
        "platform": carried(mechanism, mechanism.end, pin.SE3.Identity()),
        "begin": mechanism.placement(mechanism.q_home, mechanism.end).translation.tolist(),
        "ticks": ticks,
    }


def main() -> None:
    """Print a table."""
    ticks = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    mechanism = cinegen.load("delta4")
    with tempfile.TemporaryDirectory() as folder:
        code = generate(
            mechanism, Language.JAVASCRIPT, name="robot", tasks=["platform:position"], functions=[Function.TICK]
        )
        for name, text in {**code, "run.mjs": NODE, "package.json": "{}"}.items():
            (Path(folder) / name).write_text(text)
        (Path(folder) / "delta.json").write_text(json.dumps(description(mechanism, ticks)))
        command = ["npm", "install", "--no-audit", "--no-fund", "--loglevel=error", PACKAGE]
        subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
        subprocess.run(["node", "--no-warnings", "run.mjs"], cwd=folder, check=True)
        results = json.loads((Path(folder) / "found.json").read_text())
    print(f"{'':30}{'us a tick':>10}{'ratio':>8}{'loops open':>12}{'distance to target, m':>24}")
    for name, result in results.items():
        offset = 0.0 if name == "cinegen" else mechanism.q_home
        closure = distance = 0.0
        for state in result["found"]:
            q = np.array(state["q"]) + offset
            closure = max(closure, mechanism.closure(q))
            reached = mechanism.placement(q, mechanism.end).translation
            distance = max(distance, float(np.linalg.norm(reached - state["target"])))
        ratio = result["us"] / results["cinegen"]["us"]
        print(f"{name:30}{result['us']:10.1f}{ratio:8.1f}{closure:12.1e}{distance:24.1e}")


if __name__ == "__main__":
    main()
