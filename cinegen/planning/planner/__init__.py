"""A way to a goal around obstacles."""

from cinegen.planning.planner.attempt import Attempt
from cinegen.planning.planner.plan import Plan, plan
from cinegen.planning.planner.sampling import rrt_connect
from cinegen.planning.planner.status import PlanStatus

__all__ = ["Attempt", "Plan", "PlanStatus", "plan", "rrt_connect"]
