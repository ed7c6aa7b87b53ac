"""Compiled functions: roots of Merlet's elimination; Taylor steps along paths of solutions."""
