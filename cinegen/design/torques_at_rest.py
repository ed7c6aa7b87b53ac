"""Torques that hold a mechanism at rest, and their derivatives by its parameters.

Torques balance loads by virtual work. With the Jacobian's columns u_k of the point where a force f acts, and w_k of its
body's angular velocity, on which a moment m does work, the joints of the tree need

    t_k = -sum (f . u_k + m . w_k),

and the fixed joints, which the others follow by B, need t_f + B^T t_m. All derivatives follow from those of the columns
(Lie brackets) and of B, see `cinegen.design.design`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.design.dimensions import LinkMass
from cinegen.design.errors import DesignError
from cinegen.design.evaluation import DesignEvaluation
from cinegen.dynamics.errors import MassError
from cinegen.model.masses import stated

_CONSISTENT = 1e-8  # dimensionless: the loops that the fixed joints' motions leave open


def holding_torques(
    evaluation: DesignEvaluation,
    wrenches: Mapping[str, ArrayLike] | None = None,
    gravity: ArrayLike | None = None,
    massless: bool = False,
    masses: Mapping[str, LinkMass] | None = None,
) -> tuple[Array, Array]:
    """Return the torques and forces of the fixed joints that hold a mechanism at rest, and their derivatives.

    Args:
        evaluation: of a design whose fixed joints are the actuated ones.
        wrenches: force (N) and moment (N m), (6,), on nodes, in the world's axes at their origins.
        gravity: acceleration in the world, m/s2; the mechanism's if None.
        massless: whether links without mass count as having none.
        masses: of links, with derivatives by the design's columns; those of the file unless given, at their centres in
            the links' frames at all values of the parameters.

    Returns:
        (count, fixed), N m and N, and (count, fixed, columns) by the parameters, m and rad.

    Raises:
        MassError: links have no mass.
        DesignError: there are more fixed joints than degrees of freedom, so that torques are not determined.
        UnknownNameError: no such node.
    """
    design, mechanism = evaluation.design, evaluation.design.mechanism
    fixed = [mechanism.v_index(name) for name in design.fixed]
    left = evaluation.loop_joints @ evaluation.follow + evaluation.loop_joints[:, :, fixed]
    if np.abs(left).max(initial=0.0) > _CONSISTENT * np.abs(evaluation.loop_joints[:, :, fixed]).max(initial=1.0):
        raise DesignError(
            f"{mechanism.name} has more fixed joints than degrees of freedom: loads do not determine their torques"
        )
    acceleration = np.asarray(mechanism.gravity if gravity is None else gravity, dtype=float)
    bodies = _bodies(evaluation, masses)
    if mechanism.massless and acceleration.any() and not massless:
        names = ", ".join(f"'{name}'" for name in mechanism.massless[:6])
        raise MassError(f"{mechanism.name}: these links have no mass: {names}: give them, or pass massless=True")
    count, columns, nv = len(evaluation), len(design.names), mechanism.model.nv
    still, at_rest = np.zeros(columns), np.zeros((3, columns))
    loads = [
        (node, link, np.append(link.mass * acceleration, np.zeros(3)), acceleration)
        for node, link in bodies.items()
        if node in mechanism.nodes and acceleration.any()
    ]
    loads += [
        (node, LinkMass(0.0, np.zeros(3), still, at_rest), np.asarray(wrench, dtype=float), np.zeros(3))
        for node, wrench in (wrenches or {}).items()
    ]
    tree, changed = np.zeros((count, nv)), np.zeros((count, columns, nv))
    screws, bends = evaluation.all_screws, evaluation.screw_derivative
    for node, body, wrench, weight in loads:
        placed, twists = evaluation.placements(node), evaluation.node_twists(node)
        point = placed[:, :3, :3] @ body.centre + placed[:, :3, 3]
        moved = twists[..., :3] + np.cross(twists[..., 3:], point[:, None])
        moved += np.swapaxes(placed[:, :3, :3] @ body.centre_by, 1, 2)
        supports, force, moment = evaluation.supports(node), wrench[:3], wrench[3:]
        by_joint = screws[..., :3] + np.cross(screws[..., 3:], point[:, None])
        tree -= (by_joint @ force + screws[..., 3:] @ moment) * supports
        bent = bends[..., :3] + np.cross(bends[..., 3:], point[:, None, None])
        bent += np.cross(screws[:, None, :, 3:], moved[:, :, None])
        changed -= (bent @ force + bends[..., 3:] @ moment) * supports
        changed -= body.mass_by[:, None] * ((by_joint @ weight) * supports)[:, None]
    torques = tree[:, fixed] + np.einsum("cvf,cv->cf", evaluation.follow, tree)
    by_parameters = changed[..., fixed] + np.einsum("cvf,ckv->ckf", evaluation.follow, changed, optimize=True)
    by_parameters += np.einsum("ckvf,cv->ckf", evaluation.follow_derivative, tree, optimize=True)
    return torques, np.swapaxes(by_parameters, 1, 2)


def _bodies(evaluation: DesignEvaluation, masses: Mapping[str, LinkMass] | None) -> Mapping[str, LinkMass]:
    """Return masses with derivatives by the design's columns; those of the file do not change."""
    if masses is not None:
        return masses
    n = len(evaluation.design.names)
    bodies = stated(evaluation.design.mechanism)
    return {name: LinkMass(link.mass, link.centre, np.zeros(n), np.zeros((3, n))) for name, link in bodies.items()}
