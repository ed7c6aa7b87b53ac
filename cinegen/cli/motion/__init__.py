"""Commands that move robots: inverse kinematics, planning, driving."""
