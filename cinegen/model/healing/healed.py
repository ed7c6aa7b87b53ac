"""The analysis of a RAFF file whose loops are nearly redundant, for `raff2urdf`, which can't heal them itself."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cinegen.model.build import build
from raff2urdf import closure
from raff2urdf.conversion import describe
from raff2urdf.errors import RaffWarning
from raff2urdf.loops.mobility import Analysis, loop_kind
from raff2urdf.raff.document import Document, RaffRobot
from raff2urdf.readers.urdf import joints, origin
from raff2urdf.readers.urdf_file import parse


def healed(document: Document, robot: RaffRobot, folder: Path, loops: Mapping[str, str] | None) -> Analysis:
    """Return the analysis of a robot that is healed or relaxed as `cinegen.load` does, with the same warnings.

    Args:
        document: that holds the robot.
        robot: the robot.
        folder: of the RAFF file.
        loops: kinds (rigid, prismatic, revolute, ball) that replace the file's, by the loop's name.

    Raises:
        ClosureError: the loops can't be closed.
        RaffError: `loops` names a loop or a kind that does not exist; a length is too large.
    """
    name = document.source.name
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RaffWarning)  # graphics that can't be shown are the caller's
        urdf, written = describe(document, robot, folder, loops)
    mechanism = build(urdf, written, name=name, relax=None)
    constraints = mechanism.source.constraints or written
    before, after = (
        {joint.get("name"): origin(joint, name) for joint in joints(parse(text, name))}
        for text in (urdf, mechanism.source.urdf)
    )
    plain = mechanism.successive
    system = plain.structure.own_system()
    return Analysis(
        mobility=mechanism.mobility,
        rows=system.rows,
        rank=mechanism.loop_rank,
        actuated=mechanism.actuated,
        gap=mechanism.gap_as_written,
        closure=max(closure.gaps(system, plain.q_home)),
        kinds=tuple(loop_kind(loop["kind"]) for loop in constraints["loops"]),
        home={joint["name"]: float(plain.q_home[plain.q_index(joint["name"])]) for joint in written["joints"]},
        length=mechanism.length,
        uncontrolled=mechanism.uncontrolled,
        dependent=mechanism.dependent,
        moved={
            i: (np.array(loop["first"]["placement"]), np.array(loop["second"]["placement"]))
            for i, loop in enumerate(constraints["loops"])
        },
        origins={name: placed for name, placed in after.items() if not np.array_equal(placed, before[name])},
    )
