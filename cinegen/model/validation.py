"""Cross-validation: a robot as Pinocchio reads its URDF, and the same robot through URDF -> RAFF -> URDF."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import LoadError
from cinegen.model.load import load
from cinegen.model.mechanism import Mechanism
from raff2urdf import dumps, readers
from raff2urdf.readers.urdf_file import parse
from raff2urdf.urdf2raff.robot import RaffImport, import_tree

AGREES = 1e-9
"""Largest difference of robots that agree, m and rad; of mass matrices, relative to their largest entry."""

SAMPLES = 20


class Validation(NamedTuple):
    """Largest differences between two descriptions of a robot.

    Attributes:
        joints: number of joints that move.
        frames: of entries of the placements of all links (m), at `SAMPLES` random configurations and at 0.
        jacobians: of entries of the Jacobians of all links, in their own frames (m, rad).
        masses: of entries of the mass matrix, relative to its largest.
        home: of home values of joints (m, rad).
    """

    joints: int
    frames: float
    jacobians: float
    masses: float
    home: float

    @property
    def agrees(self) -> bool:
        """True if no difference is larger than `AGREES`."""
        return bool(max(self[1:]) <= AGREES)


def validate(path: Path) -> Validation:
    """Compare a URDF as Pinocchio reads it with the mechanism that it becomes through URDF -> RAFF -> URDF.

    Pinocchio's own reader (`pin.buildModelFromXML`) and algorithms are the reference. Couplings (mimic) are not
    applied: all joints move independently on both sides.

    Args:
        path: path of a URDF without loops.

    Raises:
        RaffError: the URDF can't be read.
        CinegenError: no joint moves, or the mechanism can't be loaded.
    """
    text = path.read_text(encoding="utf-8")
    imported = import_tree(parse(text, str(path)), str(path), readers.read(path).constraints)
    if not imported.joints:
        raise LoadError(f"{path}: nothing moves: there is nothing to compare")
    with tempfile.TemporaryDirectory() as folder:
        raff = Path(folder, f"{path.stem}.raff")
        raff.write_text(dumps(imported.document), encoding="utf-8")
        return _compare(pin.buildModelFromXML(text), load(raff), load(path), imported)


def _compare(original: Any, ours: Mechanism, direct: Mechanism, imported: RaffImport) -> Validation:
    """Return differences of Pinocchio's model and a mechanism made of RAFF; and of the latter's home and the URDF's."""
    pairs = [
        (
            original.joints[original.getJointId(theirs)],
            ours.model.joints[ours.model.getJointId(name)],
            imported.offsets[name],
        )
        for theirs, name in imported.joints.items()
    ]
    columns = [joint.idx_v for joint, _, _ in pairs], [joint.idx_v for _, joint, _ in pairs]
    frames = {entry.name: i for i, entry in enumerate(original.frames) if entry.type == pin.FrameType.BODY}
    links = [(frames[link], ours.frame_id(node)) for link, node in imported.nodes.items() if link in frames]
    rng, worst = np.random.default_rng(0), np.zeros(3)
    for values in (np.zeros(len(pairs)), *rng.uniform(-math.pi, math.pi, (SAMPLES, len(pairs)))):
        q, p = pin.neutral(original), pin.neutral(ours.model)
        for (theirs, our, offset), value in zip(pairs, values, strict=True):
            q[theirs.idx_q : theirs.idx_q + theirs.nq] = value if theirs.nq == 1 else (math.cos(value), math.sin(value))
            p[our.idx_q] = value + offset
        known, made = _evaluate(original, q), _evaluate(ours.model, p)
        errors = [
            (
                np.abs(known.oMf[i].homogeneous - made.oMf[j].homogeneous).max(),
                np.abs(_jacobian(original, known, i, columns[0]) - _jacobian(ours.model, made, j, columns[1])).max(
                    initial=0.0
                ),
            )
            for i, j in links
        ]
        masses = [
            _masses(model, data, of)
            for model, data, of in ((original, known, columns[0]), (ours.model, made, columns[1]))
        ]
        scale = np.abs(masses[0]).max(initial=0.0) or 1.0
        worst = np.maximum(worst, [*np.max(errors, axis=0), np.abs(masses[0] - masses[1]).max(initial=0.0) / scale])
    q, p = ours.q_home, direct.q_home
    home = [
        abs(q[ours.q_index(name)] - p[direct.q_index(theirs)] - imported.offsets[name])
        for theirs, name in imported.joints.items()
    ]
    frame, jacobian, mass = worst.tolist()
    return Validation(len(pairs), frame, jacobian, mass, max(home, default=0.0))


def _evaluate(model: Any, q: Array) -> Any:
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    pin.crba(model, data, q)
    return data


def _jacobian(model: Any, data: Any, frame: int, columns: list[int]) -> Array:
    return np.asarray(pin.getFrameJacobian(model, data, frame, pin.LOCAL)).reshape(6, model.nv)[:, columns]


def _masses(model: Any, data: Any, columns: list[int]) -> Array:
    upper = np.triu(data.M)
    return np.asarray((upper + np.triu(data.M, 1).T)[np.ix_(columns, columns)])
