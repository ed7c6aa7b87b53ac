"""The way back: from a URDF to RAFF."""
