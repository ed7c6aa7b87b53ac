"""Colours of links: people with any colour vision distinguish branches, and none looks like a status of the page.

Colour vision is simulated by the matrices of Machado, Oliveira and Fernandes, "A physiologically-based model for
simulation of color vision deficiency" (2009), severity 1.0; differences are CIE 1976, where 2.3 is just noticeable.
"""

from itertools import combinations

import numpy as np
import pytest

from raff2urdf.graphics.body_shapes import SHARED
from raff2urdf.graphics.skeleton import BASE, BRANCHES, JOINT

NORMAL = np.eye(3)
DEFICIENT = {
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
WHITE = np.array([0.95047, 1.0, 1.08883])


def lab(colour, vision=NORMAL):
    """CIE L*a*b* (3,) of an sRGB colour as somebody sees it."""
    value = np.asarray(colour, dtype=float)
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    xyz = TO_XYZ @ np.clip(np.asarray(vision) @ linear, 0.0, 1.0) / WHITE
    x, y, z = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("vision", [NORMAL, *DEFICIENT.values()], ids=["normal", *DEFICIENT])
def test_branches_are_distinguished(vision):
    for one, other in combinations([*BRANCHES, BASE, JOINT, SHARED], 2):
        assert np.linalg.norm(lab(one, vision) - lab(other, vision)) > (0.0 if {one, other} == {BASE, JOINT} else 15.0)
