"""raff2urdf: RAFF, the Robot Arm File Format, to and from URDF with explicit closed-loop constraints.

    import raff2urdf

    document = raff2urdf.load("robots/delta4.raff")
    raff2urdf.convert("robots/delta4.raff", "generated")
    raff2urdf.to_raff("panda.urdf", "panda.raff")

Errors are `RaffError`, with file, line, column and the likely remedy. Names are imported when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from raff2urdf.lazy import lazy_names

if TYPE_CHECKING:
    from raff2urdf.conversion import convert as convert
    from raff2urdf.errors import RaffClosureError as RaffClosureError
    from raff2urdf.errors import RaffError as RaffError
    from raff2urdf.errors import RaffWarning as RaffWarning
    from raff2urdf.raff.check import check as check
    from raff2urdf.raff.document import Document as Document
    from raff2urdf.raff.reader import load as load
    from raff2urdf.raff.reader import loads as loads
    from raff2urdf.raff.writer import dumps as dumps
    from raff2urdf.urdf2raff.conversion import to_raff as to_raff

__all__, __getattr__, __dir__ = lazy_names(__name__)
