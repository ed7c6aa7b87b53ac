"""When a vortex is let go: once the way to the goal is free (De Medio and Oriolo 1991, figure 4).

Let alpha be the angle from the vortex v to the attraction a. "As the robot circumvents the obstacle, this angle
decreases till zero. At the point Q where this happens, the vortex field can be discarded, since the QG line is free."
Its modulus would jump there, so the vortex is "multiplied by sin(alpha), so to approach zero with continuity as the
scissors close". Beyond Q the sine of an angle without sign would rise again: it has to be 0 there.

Along a flat side the angle grows before it closes at the corner, beyond a right angle: it decreases all the way only
round what is curved. Nothing here depends on that.

In the plane v is perpendicular to the normal n. Measured from v toward the obstacle, that is toward -n, the unit
attraction is cos(alpha) v - sin(alpha) n. So -n.a / |a| = sin(alpha), exactly, and with its sign: above 0 as long as
the attraction points into the obstacle's side, below 0 beyond Q. The paper's weight, ended at Q, is max(0, -n.a / |a|).

In space the attraction also has a part b across n and v. Then sin(alpha)^2 = (n.a)^2 + (b.a)^2 (for |a| = 1) does not
vanish at Q, and the scissors jump there; and it may be large where nothing is in the way. max(0, -n.a / |a|) is still
continuous, and still right: an obstacle that is convex lies behind the plane through its nearest point across n, and
where n.a >= 0 the line to the goal never goes behind it. So `facing` is used; the two agree in the plane.

Discarded so, one vortex never stops a point: where a + weight V = 0, the part of it along n, which is n.a, is 0; so the
weight is 0; so a is 0, which is the goal. A vortex that is not discarded does stop it, where V = -a.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def facing(attractions: ArrayLike, normals: ArrayLike) -> Array:
    """(m,) max(0, -n.a / |a|), in [0, 1]: the weight of a vortex; 0 at the goal.

    Args:
        attractions: (m, 3) a, of any unit.
        normals: (m, 3) unit vectors n out of the obstacle.
    """
    return np.asarray(np.maximum(-(_unit(attractions) * np.asarray(normals, dtype=float)).sum(axis=-1), 0.0))


def scissors(attractions: ArrayLike, vortices: ArrayLike, normals: ArrayLike) -> Array:
    """(m,) the paper's weight: sin(alpha) before Q, 0 from there on; 0 where a or v is none.

    Args:
        attractions: (m, 3) a, of any unit.
        vortices: (m, 3) v, of any unit.
        normals: (m, 3) unit vectors n out of the obstacle.
    """
    sine = np.linalg.norm(np.cross(_unit(attractions), _unit(vortices)), axis=-1)
    return np.where(facing(attractions, normals) > 0.0, sine, 0.0)


def _unit(vectors: ArrayLike) -> Array:
    """(m, 3) unit vectors; zero stays zero."""
    v = np.asarray(vectors, dtype=float)
    size = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(v / np.where(size > 0.0, size, 1.0))
