"""Every assembly mode of a Gough platform with six free legs: up to 40, found by following 40 complex solutions."""

from cinegen.study.hexapod.hexapod import Approach, Hexapod, HexapodError, Modes

__all__ = ["Approach", "Hexapod", "HexapodError", "Modes"]
