"""The MiniDelta against the closed form of the delta.

R. Clavel, "Delta, a fast robot with parallel geometry", Int. symposium on Industrial Robots, 1988: the platform keeps
its orientation, so that each arm is a triangle of its own. Seen from arm i, with P the platform's centre turned by
-gamma_i, the wrist is at P + (p, 0, 0), the elbow on a circle (the upper arm turns about the shoulder), and the forearm
is the distance between them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
import pytest
from elementary import angle_between, at, document, forward, length, limits, link, turn, within_limits

import cinegen

SHOULDERS = ("joint1", "joint6", "joint12")
FIRST = (1, 6, 12)


@dataclass(frozen=True)
class Delta:
    """A delta's lengths (m): of base and platform radius, upper arm and forearm; the arms' angles."""

    base: float
    platform: float
    upper: float
    forearm: float
    gammas: tuple[float, ...]

    @classmethod
    def of(cls, name: str) -> Delta:
        """The lengths that robots/<name>.raff gives, the same in all three arms."""
        text = document(name)

        def all_three(numbers, parameter):
            (value,) = {getattr(link(text, n).parameters, parameter) for n in numbers}
            return length(text, value)

        return cls(
            base=all_three(FIRST, "d"),
            platform=length(text, link(text, 20).parameters.d),
            upper=all_three([n + 1 for n in FIRST], "d"),
            forearm=all_three([n + 3 for n in FIRST], "d"),
            gammas=tuple(math.radians(link(text, n).parameters.gamma) for n in FIRST),
        )

    def wrists(self, position: np.ndarray) -> list[np.ndarray]:
        """The wrists, each seen from its arm, the shoulder's axis at the origin."""
        reach = np.array([self.platform - self.base, 0.0, 0.0])
        return [turn("z", -gamma)[:3, :3] @ position + reach for gamma in self.gammas]

    def inverse(self, position: np.ndarray) -> np.ndarray | None:
        """Motors (rad) that bring the platform there, elbows outside; None: out of reach.

        |wrist - elbow| = forearm is w_x cos + w_z sin = k.
        """
        motors = []
        for w in self.wrists(position):
            k = (w @ w + self.upper**2 - self.forearm**2) / (2.0 * self.upper)
            h = math.hypot(w[0], w[2])
            if abs(k) >= h:
                return None
            angle = math.atan2(w[2], w[0]) + math.acos(k / h)
            motors.append((angle + math.pi) % (2.0 * math.pi) - math.pi)
        return np.array(motors)


REGION = (-2.5, -2.5, -5.0), (2.5, 2.5, -0.5)  # m, where positions are drawn from
STEP = 0.5  # rad between two forward solutions on the way


def reachable(count: int, seed: int, margin: float = 0.0) -> list[tuple[np.ndarray, np.ndarray]]:
    """Random positions within the motors' limits, with the motors' values."""
    delta, rng = Delta.of("delta4"), np.random.default_rng(seed)
    low, high = np.add(np.radians(link(document("delta4"), 1).limits), [margin, -margin])
    found = []
    while len(found) < count:
        position = rng.uniform(*REGION)
        motors = delta.inverse(position)
        if motors is not None and (motors >= low).all() and (motors <= high).all():
            found.append((position, motors))
    return found


def test_motors_set_by_the_closed_form_bring_the_platform_there_with_its_orientation_kept(robot):
    """The way there leads from home through closed configurations."""
    mechanism = robot("delta4")
    upright = mechanism.placement(mechanism.q_home, "platform").rotation
    assert upright == pytest.approx(np.eye(3), abs=1e-9)
    for position, motors in reachable(150, seed=0):
        q = forward(mechanism, mechanism.q_home, motors, STEP)
        there = mechanism.placement(q, "platform")
        assert there.translation == pytest.approx(position, abs=1e-9)
        assert angle_between(upright, there.rotation) <= 1e-9
        assert np.array_equal(at(mechanism, q, SHOULDERS), motors)


def test_dragged_to_random_positions_its_motors_stand_where_the_closed_form_says(robot):
    """Where all passive joints have room too the solver arrives; everywhere it stays with the closed form."""
    mechanism, delta = robot("delta4"), Delta.of("delta4")
    solver = cinegen.Solver(mechanism, dt=0.2)
    task = solver.add_task("platform", rotation=0)
    low, high = limits(mechanism, mechanism.joints)
    order = [mechanism.q_index(joint) for joint in mechanism.joints]
    arrived = 0
    for position, motors in reachable(20, seed=11, margin=0.05):
        goal = forward(mechanism, mechanism.q_home, motors, STEP)[order]
        roomy = (goal > low).all() and (goal < high).all()
        task.target = pin.SE3(np.eye(3), position)
        for _ in range(150):
            step = solver.step()
            there = mechanism.placement(step.q, "platform")
            assert angle_between(np.eye(3), there.rotation) <= 1e-9
            assert within_limits(mechanism, step.q)
            if step.errors[0][0] <= 1e-10:
                break
        assert delta.inverse(there.translation) == pytest.approx(at(mechanism, step.q, SHOULDERS), abs=1e-9)
        if roomy:
            assert there.translation == pytest.approx(position, abs=1e-9), step.status
            assert at(mechanism, step.q, SHOULDERS) == pytest.approx(motors, abs=1e-8)
            arrived += 1
    assert arrived >= 12
