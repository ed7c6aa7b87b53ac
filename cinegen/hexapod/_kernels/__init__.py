"""Compiled functions: Taylor steps along paths of solutions."""
