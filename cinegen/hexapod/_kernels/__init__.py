"""Compiled functions: Merlet's elimination, its eigenvalues and roots; Taylor steps along paths of solutions."""
