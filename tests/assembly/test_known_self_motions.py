"""Self-motions that the literature knows: each is found, is the one that is known, and nothing is called complete."""

from __future__ import annotations

import numpy as np
import pytest
from assembled import apart, closings, places
from linkages import hexapod
from numpy.random import default_rng as rng
from test_self_motions import moves, on_self_motions

import cinegen
from cinegen.assembly import assembly_modes

HALF_TURN = np.diag([-1.0, -1.0, 1.0])  # about z


def moved(m: cinegen.Mechanism, q: np.ndarray) -> np.ndarray:
    """(4, 4) the displacement of the tool from home to q, in the world."""
    return (m.placement(q, "tool") * m.placement(m.q_home, "tool").inverse()).homogeneous


# --- platforms on six legs ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("symmetry", ["line", "plane"])
def test_bricards_octahedra_are_flexible(built, symmetry):
    """R. Bricard, "Mémoire sur la théorie de l'octaèdre articulé", J. math. pures et appliquées 3, 1897. One face is
    the base, the opposite one the platform, and Merlet's determinant vanishes."""
    r = rng(0)
    base = r.uniform(-1.0, 1.0, (3, 3))
    platform = base @ HALF_TURN
    if symmetry == "plane":  # two pairs of vertices are mirrored, and two vertices are in the plane
        base[2, 0] = 0.0
        platform = np.vstack([base[:2] * [-1.0, 1.0, 1.0], [0.0, *r.uniform(-1.0, 1.0, 2)]])
    pairs = [(i, j) for i in range(3) for j in range(3) if i != j]
    m = built(hexapod(rng(1), "UpS", np.array([base[i] for i, _ in pairs]), np.array([platform[j] for _, j in pairs])))
    modes = assembly_modes(m)
    assert moves(modes) == [(1, 12)]
    assert not modes.complete
    known = [places(m, q, ["tool"]) for q in modes]  # the isolated ones, too, though no root shows them
    assert on_self_motions(modes, [q for q in closings(modes, 25) if apart(places(m, q, ["tool"]), known) > 1e-5])
    there = moved(m, modes.self_motions[0].configuration)
    here = platform @ there[:3, :3].T + there[:3, 3]
    assert np.abs(here - platform).max() > 0.01
    middle, across = 0.5 * (base + here), here - base
    if symmetry == "line":
        along = np.cross(across[0], across[1]) / np.linalg.norm(np.cross(across[0], across[1]))
        assert across @ along == pytest.approx(np.zeros(3), abs=1e-9)
        assert np.cross(middle[1:] - middle[0], along) == pytest.approx(np.zeros((2, 3)), abs=1e-9)
    else:
        normal = across[0] / np.linalg.norm(across[0])
        assert np.cross(across[1], normal) == pytest.approx(np.zeros(3), abs=1e-9)
        in_plane = np.array([middle[1], base[2], here[2]]) - middle[0]
        assert in_plane @ normal == pytest.approx(np.zeros(3), abs=1e-9)
