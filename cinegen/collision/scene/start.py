"""Where a robot starts: `[start]`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.scene.mobile import X, Y
from cinegen.collision.scene.place import placement, said
from cinegen.collision.scene.table import Table
from cinegen.errors import ClosureError
from cinegen.model import Mechanism
from cinegen.tolerances import AT_LIMIT
from raff2urdf.errors import did_you_mean

Array = NDArray[np.float64]

_STEP = 0.1  # rad or lengths: how far motors go at once on the way from home


def start(table: Table, mechanism: Mechanism, mobile: bool) -> Array:
    """A closed configuration (nq,) inside all limits.

    Its keys: of a mobile robot `point`; of others `joints`, names and values (rad, m), those that are not named stay
    at home; where the base can move, also `point` and `rpy` of the base. Of a robot with loops, joints that have
    motors stand where they are said to, and their motion from home leads the others, unless one of those is named
    too: then they are the guess from which the loops are closed.

    Raises:
        SceneError: a value is wrong, a joint is unknown or beyond its limits, or the loops can't be closed.
    """
    if mobile:
        x, y = table.vector("point", 2).tolist() if "point" in table else (0.0, 0.0)
        table.finish()
        return mechanism.configuration({X: x, Y: y})
    values = _joints(table.inner("joints"), mechanism) if "joints" in table else {}
    home = np.array(mechanism.q_home)
    if mechanism.floating and ("point" in table or "rpy" in table or "angle" in table):
        home[:7] = pin.SE3ToXYZQUAT(placement(table))
    table.finish()
    q = mechanism.configuration(values, home)
    if mechanism.loops:
        try:
            q = _closed(mechanism, home, q, any(name not in mechanism.actuated for name in values))
            _unwind(mechanism, q)
        except ClosureError as error:
            raise table.wrong("joints", f"can't be had: {error}") from None
    for name in mechanism.joints:
        _check_limits(table, mechanism, name, float(q[mechanism.q_index(name)]), name in values)
    return q


def said_start(mechanism: Mechanism, q: Array, mobile: bool) -> dict[str, Any]:
    """The keys that `start` reads."""
    if mobile:
        return {"point": [float(q[mechanism.q_index(name)]) for name in (X, Y)]}
    joints: dict[str, Any] = {"joints": {name: float(q[mechanism.q_index(name)]) for name in mechanism.joints}}
    return joints | (said(pin.XYZQUATToSE3(q[:7])) if mechanism.floating else {})


def _joints(table: Table, mechanism: Mechanism) -> dict[str, float]:
    for name in table:
        if name not in mechanism.joints:
            raise table.wrong(f"'{name}'", f"is no joint of {mechanism.name}{did_you_mean(name, mechanism.joints)}")
    return {name: table.number(name) for name in table}


def _closed(mechanism: Mechanism, home: Array, q: Array, guessed: bool) -> Array:
    """Near q, with the motors as there; from home along the motors' way, unless q holds a guess for the others."""
    motors = [mechanism.q_index(name) for name in mechanism.actuated]
    columns = [mechanism.v_index(name) for name in mechanism.actuated]
    if not guessed:
        way = q[motors] - home[motors]
        steps = int(np.ceil(np.abs(way / mechanism.scale[columns]).max(initial=0.0) / _STEP))
        there = home.copy()
        for step in range(1, steps + 1):
            there[motors] = home[motors] + way * (step / steps)
            there = mechanism.close(there, locked=mechanism.actuated)
        there[motors] = q[motors]
        q = there
    return mechanism.close(q, locked=mechanism.actuated)


def _unwind(mechanism: Mechanism, q: Array) -> None:
    """Takes whole turns from joints without motors: a guess far away may have added some."""
    unwound = mechanism.limits.unwound(q)
    for name in mechanism.limits.exceeded(q, AT_LIMIT):
        if name not in mechanism.actuated:
            q[mechanism.q_index(name)] = unwound[mechanism.q_index(name)]


def _check_limits(table: Table, mechanism: Mechanism, name: str, value: float, said: bool) -> None:
    low, high, *_ = mechanism.limits[name]
    if low - AT_LIMIT <= value <= high + AT_LIMIT:
        return
    why = f"'{name}' is at {value:.6g}, its limits are {low:.6g} and {high:.6g}"
    raise table.wrong("joints", why if said else f"{why}: say where it starts, or other motors")
