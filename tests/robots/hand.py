"""A wild hand that tasks a robot about, and what must hold at every tick all the same."""

import numpy as np
import pinocchio as pin
import pytest

import cinegen
from cinegen import Status

DT = 1 / 60


class Hand:
    """Tasks at random: near and far targets that jump every 40 ticks or so, on one node or two, held and let go."""

    def __init__(self, mechanism: cinegen.Mechanism, solver: cinegen.Solver, seed: int) -> None:
        self.mechanism, self.solver = mechanism, solver
        self.rng = np.random.default_rng(seed)
        self.reach = [mechanism.q_home, *mechanism.random_closed(8, seed)]

    def target(self, node: str) -> pin.SE3:
        """Somewhere: where the node can be, near by, or up to a thousand lengths away."""
        rng, mechanism = self.rng, self.mechanism
        pose = mechanism.placement(self.reach[rng.integers(len(self.reach))], node)
        if rng.random() < 0.3:
            return pose
        away = 10.0 ** rng.uniform(-3.0, 1.0 if rng.random() < 0.8 else 3.0)
        turned = pin.exp3(rng.normal(0.0, 1.0, 3) * rng.choice([0.1, 1.0, 3.0]))
        return pin.SE3(pose.rotation @ turned, pose.translation + away * mechanism.length * rng.normal(0.0, 1.0, 3))

    def grasp(self) -> None:
        """One more task: of the end most of the time, of any node else; all of its pose or a part of it."""
        rng = self.rng
        node = self.mechanism.nodes[-1] if rng.random() < 0.7 else str(rng.choice(self.mechanism.nodes))
        translation, rotation = [(3, 0), (3, 3), (3, 3), (int(rng.integers(4)), int(rng.integers(4)))][rng.integers(4)]
        task = self.solver.add_task(node, self.target(node), translation, rotation)
        task.weight = float(rng.choice([1.0, 1.0, 0.01, 30.0]))

    def act(self) -> None:
        """What the hand does before a tick."""
        rng, tasks = self.rng, self.solver.tasks
        if not tasks:
            if rng.random() < 0.2:
                self.grasp()
        elif rng.random() < 1 / 200 and len(tasks) < 2:
            self.grasp()
        elif rng.random() < 1 / 300:
            self.solver.remove_task(tasks[rng.integers(len(tasks))])
        for task in self.solver.tasks:
            if rng.random() < 1 / 40:
                task.target = self.target(task.node)
            elif rng.random() < 0.5:  # and it trembles
                shaken = task.target.translation + rng.normal(0.0, 1e-4 * self.mechanism.length, 3)
                task.target = pin.SE3(task.target.rotation, shaken)


def check(mechanism: cinegen.Mechanism, before: np.ndarray, step: cinegen.Step) -> None:
    """What holds at every tick."""
    model = mechanism.model
    assert np.isfinite(step.q).all()
    assert np.isfinite(step.v).all()
    assert isinstance(step.status, Status)
    assert mechanism.closure(step.q) <= 1e-9
    assert step.closure <= 1e-9
    assert (step.q >= model.lowerPositionLimit).all()
    assert (step.q <= model.upperPositionLimit).all()
    assert (np.abs(step.v) <= model.upperVelocityLimit * (1.0 + 1e-9)).all()
    moved = pin.difference(model, before, step.q)
    assert (np.abs(moved) / mechanism.scale).max(initial=0.0) <= 0.1 * (1.0 + 1e-9)
    assert step.v * DT == pytest.approx(moved, abs=1e-12)
    assert 0.0 <= step.speed_scale <= 1.0
