"""Inverse solutions of a node's pose, as assembly modes of the linkages that the pose closes."""
