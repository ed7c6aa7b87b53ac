"""Every assembly mode of a Gough platform with six free legs: up to 40, found by following 40 complex solutions."""

from cinegen.assembly.hexapod.hexapod import Approach, Hexapod, HexapodError, Modes

__all__ = ["Approach", "Hexapod", "HexapodError", "Modes"]
