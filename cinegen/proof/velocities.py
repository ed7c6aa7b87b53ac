"""Equations with velocities, from which singular values are bounded: of all joints, of the node, and of open loops.

Singular values of type 1 are those of the node's twist by the velocities of all joints; those of type 2 are of the
loops' opening twists by the passive joints' (`cinegen.loops.screws`). Both are inverse to K = N F_x^-1 F_w: w is the
node's twist, or the openings; F is what the document has without them; N yields the joints' velocities.

Twists are velocities of virtual joints, whose values are 0. The node has three, which turn it about its origin. The
second end of each loop has six, and a coupling one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.loops.motions import free_motions, orthonormal
from cinegen.proof.exported_equations import Exporter
from cinegen.singularities.ball_joints import counted
from cinegen.singularities.slice import POSE
from raff2urdf.closure import rank
from raff2urdf.raff.document import LoopKind

_ORDER = ("rz", "ry", "rx", "x", "y", "z")  # of a loop's virtual joints


class VelocityExporter(Exporter):
    """Writes equations with virtual joints, and what singular values are made of."""

    @property
    def _start(self) -> int:
        return len(self._joints) + 6

    def document(self, q: Any) -> dict[str, Any]:
        """Return the equations as JSON values, with what singular values are made of."""
        mechanism, start, loops = self._mechanism, self._start, len(self._mechanism.loops)
        self._turned = [("xyz"[k], start + k) for k in (2, 1, 0)] if self._rotation else []
        document = super().document(q)
        names = [f"turn {k}" for k in "xyz"] + [f"open {i} {k}" for i in range(loops) for k in POSE]
        couplings = document["couplings"]
        names += [f"open coupling {i}" for i in range(len(couplings))]
        document["variables"] += [
            {"name": name, "prismatic": name[-2] != "r", "limits": [None, None], "at": 0.0, "unit": 1.0}
            for name in names
        ]
        for k in range(3):
            document["variables"][start + k]["prismatic"] = False
        first = start + 3 + 6 * loops
        for k, coupling in enumerate(couplings, first):
            coupling["terms"].append([k, [coupling["size"]]])
        document["closures"] += self._ball_rates()
        balls = {k for three in self._threes for k in three}
        passive = {mechanism.joints.index(name) for name in mechanism.joints} - {*document["actuated"]}
        twist, reason = self._twist(document)
        second, lack = self._second(first, len(couplings))
        return document | {
            "placements": self._placements,
            "virtual": list(range(start, len(document["variables"]))),
            "single": [k for k in document["unknown"] if k < len(self._joints) and k not in balls],
            "passive": sorted(passive),
            "exact": not mechanism.structure.idle_joints,
            "first": twist,
            "second": second,
            "unbounded": reason or lack or ("an actuated joint is part of a ball joint" if balls - passive else ""),
        }

    def _of_loop(self, i: int) -> list[dict[str, Any]]:
        """Return what closes the i-th loop, its second end moved by virtual joints."""
        closures, first = super()._of_loop(i), self._start + 3 + 6 * i
        before, chain = np.eye(3), list[list[int]]()
        for name in _ORDER:
            turned = _turned("xyz".index(name[-1]))
            chain.append([self._placement(pin.SE3(before.T @ turned, np.zeros(3))), first + POSE.index(name)])
            before = turned
        for closure in closures:
            closure["second"] = [*chain, *closure["second"]]
        kind = self._mechanism.loops[i].kind
        if kind is not LoopKind.RIGID:
            closures[-1]["rates"] = "slide" if kind is LoopKind.PRISMATIC else "turn"
        return closures

    def _ball_rates(self) -> list[dict[str, Any]]:
        """Return what is no equation: the relative angular velocities of bodies that three joints connect."""
        rates = list[dict[str, Any]]()
        for three in self._threes:
            joints = [self._joints[k] for k in three]
            carrier = int(self._model.parents[joints[0]])
            if joints[0] in self._variable:
                first: tuple[list[list[int]], int] = ([], self._placement(pin.SE3.Identity()))
                second = self._chain(carrier, joints[-1], pin.SE3.Identity())
            else:
                first, second = self._chain(0, carrier, pin.SE3.Identity()), self._target(pin.SE3.Identity())
            rates.append({
                "first": first[0], "first_end": first[1], "second": second[0], "second_end": second[1],
                "translations": [], "rotations": 0, "rates": "turn",
            })  # fmt: skip
        return rates

    def _twist(self, document: dict[str, Any]) -> tuple[list[int], str]:
        """Return the variables whose velocities are the node's twist, so far as it counts, or why they are not known.

        Rotations count if they do not follow from the translations."""
        mechanism = self._mechanism
        images = list[Any]()
        for q in mechanism.structure.samples:
            jacobians = counted(mechanism, q, self._node)
            motions = free_motions(jacobians.loops, mechanism.loop_rank)[0]
            images.append(jacobians.node @ orthonormal(motions, jacobians.cut_rates))
        ranks = [max(rank(image[:count]) for image in images) for count in (3, 6)]
        counts = 6 if ranks[1] > ranks[0] else 3
        names = [name for name in POSE[:counts] if name in self._coordinates]
        follow = [name for name in POSE[:counts] if name not in self._known]
        if follow or len(names) != max(ranks):
            return (
                [],
                f"singular values are not bounded where coordinates follow from others: {', '.join(follow or names)}",
            )
        turns = [name for name in names if name in POSE[3:]]
        if len(turns) == 2:
            return [], f"singular values are not bounded where of the angles only {' and '.join(turns)} are given"
        base = len(self._joints)
        linear = [base + POSE.index(name) for name in names if name not in turns]
        angular = [self._start + k for k in range(3)] if len(turns) == 3 else [base + POSE.index(t) for t in turns]
        return linear + angular, ""

    def _second(self, coupling: int, couplings: int) -> tuple[dict[str, Any] | None, str]:
        """Return the openings of loops by clusters and those of couplings; None without passive joints."""
        structure = self._mechanism.structure
        if structure.uncontrolled_dof:
            return None, "the actuated joints do not control all motions"
        if not structure.passive_rank:
            return None, ""
        screws, clusters = structure.screws, list[dict[str, Any]]()
        if screws.coupling_rank < couplings:
            return None, "singular values are not bounded where couplings depend on each other"
        supports = [
            [list(map(int, self._model.supports[j])) for j in anchor[::2]] for anchor in structure.system.anchors
        ]
        branches = [[x for x, y in zip(*pair, strict=False) if x == y][-1] for pair in supports]
        removed = {self._joints[k] for three in self._threes for k in three[1:]} - {*self._variable}
        for c, points in enumerate(screws.points):
            loops = np.flatnonzero(screws.cluster_of == c)
            if not len(loops):
                continue
            branch = {branches[i] for i in loops}
            if len(branch) > 1:
                return None, "singular values are not bounded where loops that share joints begin on different bodies"
            about = list[list[Any]]()
            for joint, point, share in points:
                away = float(np.linalg.norm(point)) if joint in removed else 0.0
                end = pin.SE3(np.eye(3), np.zeros(3) if away else np.array(point))
                about.append([*self._chain(min(branch), joint, end), share, away])
            clusters.append({
                "openings": [[self._start + 3 + 6 * int(i) + k for k in range(6)] for i in loops],
                "unmix": np.linalg.inv(screws.mix[np.ix_(loops, loops)]).tolist(),
                "length": float(screws.lengths[c]),
                "about": about,
            })  # fmt: skip
        unmix = np.linalg.inv(screws.coupling_mix).tolist()
        return {"clusters": clusters, "couplings": list(range(coupling, coupling + couplings)), "unmix": unmix}, ""


def _turned(k: int) -> Any:
    """Return a rotation that brings z to an axis."""
    return np.roll(np.eye(3), k + 1, axis=0)
