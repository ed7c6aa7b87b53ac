"""Python's own solver for a session in JavaScript: what that session adds is tested on mechanisms with loops, whatever
solver the page has."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pinocchio as pin

from cinegen.errors import CinegenError
from cinegen.ik import Solver

TEXT = (Path(__file__).parents[1] / "javascript" / "python_solver.js").read_text(encoding="utf-8")


def remote_solver(name, mechanism):
    """The module of a robot whose solver is here."""
    names = [""] * len(mechanism.q_home)
    for joint in mechanism.joints:
        names[mechanism.q_index(joint)] = joint
    table = {
        "robot": name,
        "names": {"joints": names, "nodes": list(mechanism.nodes)},
        "home": mechanism.q_home.tolist(),
    }
    return TEXT.replace("const TABLE = {};", f"const TABLE = {json.dumps(table)};")


class RemoteSolver:
    """The solver of one robot, as cinegen/page/static/session/solver.d.ts describes it."""

    def __init__(self, mechanism, dt):
        self.mechanism = mechanism
        self.names = {mechanism.q_index(joint): joint for joint in mechanism.joints}
        self.solver = Solver(mechanism, dt)

    def fk(self, q):
        """Return the placements of all nodes."""
        q = np.array(q)
        poses = [pin.SE3ToXYZQUAT(self.mechanism.placement(q, node)) for node in self.mechanism.nodes]
        return np.concatenate(poses).tolist()

    def close(self, q, locked):
        """Close the loops with joints locked."""
        q = np.array(q)
        if not all(locked):
            try:
                q = self.mechanism.close(q, [self.names[i] for i in np.flatnonzero(locked)])
            except CinegenError:
                return {"q": q.tolist(), "gap": None}
        return {"q": q.tolist(), "gap": self.mechanism.closure(q)}

    def tick(self, q, tasks, dt, options):
        """Move by one tick."""
        solver, nodes = self.solver, self.mechanism.nodes
        solver.dt, solver.gain, solver.damping_threshold = dt, options["gain"], options["damping"]
        if not np.array_equal(solver.q, q):
            solver.q = np.array(q)
        wanted = [(nodes[one["node"]], one["translation"], one["rotation"], tuple(one["offset"])) for one in tasks]
        present = [(t.node, t.translation, t.rotation, tuple(pin.SE3ToXYZQUAT(t.offset))) for t in solver.tasks]
        if [one[:3] for one in wanted] != [one[:3] for one in present] or not np.allclose(
            [one[3] for one in wanted], [one[3] for one in present], atol=1e-12
        ):
            for task in solver.tasks:
                solver.remove_task(task)
            for node, translation, rotation, offset in wanted:
                solver.add_task(
                    node, translation=translation, rotation=rotation, offset=pin.XYZQUATToSE3(np.array(offset))
                )
        for task, one in zip(solver.tasks, tasks, strict=True):
            task.target, task.weight = pin.XYZQUATToSE3(np.array(one["target"])), one["weight"]
        step = solver.step()
        columns = [self.mechanism.q_index(joint) for joint in step.saturated]
        return {
            "q": step.q.tolist(),
            "status": step.status.name,
            "saturated": columns,
            "errors": step.errors,
            "closure": step.closure,
        }


def answered(command, robots, dt):
    """The last line of a process whose solvers are here."""
    solvers = {name: RemoteSolver(mechanism, dt) for name, mechanism in robots.items()}
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        line = ""
        for line in process.stdout:
            asked = json.loads(line)
            if not (isinstance(asked, list) and len(asked) == 3 and asked[0] in solvers):
                break
            robot, call, arguments = asked
            process.stdin.write(json.dumps(getattr(solvers[robot], call)(*arguments)) + "\n")
            process.stdin.flush()
        process.stdin.close()
        assert process.wait(60) == 0
    return json.loads(line)
