"""Paths by sampling, and shorter ones."""
