"""Compiled: what is near, how far a motion reaches, and how links turn around obstacles."""
