"""A way to a goal around obstacles."""

from cinegen.avoid.planner.attempt import Attempt
from cinegen.avoid.planner.plan import Plan, plan, surroundings
from cinegen.avoid.planner.verdict import Verdict

__all__ = ["Attempt", "Plan", "Verdict", "plan", "surroundings"]
