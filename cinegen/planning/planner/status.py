"""What became of a plan, in one word."""

from __future__ import annotations

from enum import Enum


class PlanStatus(Enum):
    """What became of a plan, or of one attempt."""

    REACHED = "reached"
    IN_COLLISION = "in collision"
    STUCK = "stuck"
    CIRCLED = "circled"
    START_IN_COLLISION = "start in collision"
    GOAL_IN_COLLISION = "goal in collision"
    OUT_OF_REACH = "goal out of reach"
    JOINT_LIMIT = "joint limit"
    STEP_LIMIT = "step limit"
    TIME_LIMIT = "time limit"
