"""Compiled functions: how they are compiled, and the linear algebra of small matrices that all of them share."""
