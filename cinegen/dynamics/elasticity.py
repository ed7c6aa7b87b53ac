"""Elasticity of a mechanism whose joints are springs: compliance of a node, and natural frequencies.

With motions N that keep loops closed, stiffnesses k of joints, and the twists X of a node in these motions,

    C = X (N^T k N)^-1 X^T ,

for actuated joints alone C = G k^-1 G^T with G = X (S N)^-1. C. Gosselin, "Stiffness mapping for parallel
manipulators", IEEE Trans. Robotics and Automation 6, 1990. Links are rigid, and the stiffness that a preload adds by
the change of the geometry is left out.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin
import scipy.linalg

from cinegen.arrays import Array, ArrayLike
from cinegen.dynamics import plain
from cinegen.dynamics.errors import MotionError
from cinegen.dynamics.inverse_dynamics import InverseDynamics
from cinegen.dynamics.node_wrench import node_motions
from cinegen.errors import CinegenError
from cinegen.singularities.singularity import SINGULAR


class Elasticity:
    """A mechanism at rest whose joints are springs.

    Args:
        dynamics: the mechanism; its payloads take part in vibrations, wrenches and gravity do not.
        q: (nq,) configuration with closed loops.
        stiffness: of joints by name, N m/rad and N/m. Actuated joints that are left out are rigid, passive ones free.

    Attributes:
        motions: (n, k) motions that remain, dimensionless.

    Raises:
        ConfigurationError: q is no configuration.
        ClosureError: loops are open at q.
        UnknownNameError: no such joint.
        CinegenError: a stiffness is not positive.
        MotionError: the mechanism moves although no spring is deformed.
    """

    def __init__(self, dynamics: InverseDynamics, q: ArrayLike, stiffness: Mapping[str, float]) -> None:
        self._dynamics, mechanism = dynamics, dynamics.mechanism
        self._q = mechanism.structure.checked(q).copy()
        dynamics.check_closed(self._q)
        springs = np.zeros(mechanism.model.nv)
        for name, value in stiffness.items():
            column = mechanism.v_index(name)
            if not 0.0 < value < np.inf:
                raise CinegenError(f"the stiffness of joint '{name}' must be positive and finite, not {value!r:.40}")
            springs[column] = value
        moving = plain.columns_of(mechanism)
        motions = plain.motions_at(dynamics.tree, self._q)
        rigid = [i for i, name in enumerate(mechanism.actuated) if name not in stiffness]
        self.motions = motions.basis
        if rigid:
            self.motions = motions.basis @ scipy.linalg.null_space(motions.actuated[rigid], rcond=SINGULAR)
        self._scaled = self.motions * mechanism.scale[moving, None]
        self._springs = (self._scaled.T * springs[moving]) @ self._scaled  # N^T k N, J
        sprung = np.sqrt(springs[moving] / max(springs.max(initial=0.0), 1e-300))[:, None] * self._scaled
        if self.motions.shape[1] and np.linalg.svd(sprung, compute_uv=False)[-1] <= SINGULAR * mechanism.length:
            raise MotionError(
                f"{mechanism.name} moves without deforming a spring there: give the stiffness of more joints, or see "
                "whether it is singular"
            )

    def compliance(self, node: str | None = None) -> Array:
        """Return the compliance (6, 6) of a node, the end by default: its displacement (m, rad; linear above angular)
        by a wrench on it (N, N m), in the world's axes at its origin. Its inverse, where there is one, is the node's
        stiffness.

        Raises:
            UnknownNameError: no such node.
        """
        mechanism = self._dynamics.mechanism
        name = mechanism.end if node is None else node
        twists = node_motions(self._dynamics.tree, self._q, name, self.motions)
        twists[:3] *= mechanism.length
        return np.asarray(twists @ np.linalg.solve(self._springs, twists.T))

    def frequencies(self) -> Array:
        """Return the natural frequencies (k,) without damping, Hz, lowest first; infinite for motions without mass.

        Raises:
            MassError: links have no mass, and don't count as massless.
        """
        dynamics, moving = self._dynamics, plain.columns_of(self._dynamics.mechanism)
        dynamics.tree.check_masses(dynamics.counts_massless)
        whole = np.array(pin.crba(dynamics.tree.model, dynamics.tree.data, self._q))
        whole = np.triu(whole) + np.triu(whole, 1).T
        masses = self._scaled.T @ whole[moving, moving] @ self._scaled
        inverse_squares = scipy.linalg.eigh(masses, self._springs, eigvals_only=True)[::-1]  # of angular frequencies
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(np.maximum(inverse_squares, 0.0))))
