"""A way to a goal around obstacles."""

from cinegen.avoid.planner.attempt import Attempt
from cinegen.avoid.planner.plan import Plan, plan
from cinegen.avoid.planner.sampling import rrt_connect
from cinegen.avoid.planner.verdict import Verdict

__all__ = ["Attempt", "Plan", "Verdict", "plan", "rrt_connect"]
