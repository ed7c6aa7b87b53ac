"""Kinds of tasks besides frames: their attributes and their base."""
