"""Robots as simulators want them: with masses, at home, loops in the format's own words."""
