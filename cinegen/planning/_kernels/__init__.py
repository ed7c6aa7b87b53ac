"""Compiled: distances along superquadrics."""
