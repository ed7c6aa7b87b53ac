"""Writers of URDF and of simulators' formats: with masses, at home, loops in the format's own elements."""
