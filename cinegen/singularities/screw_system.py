"""`ScrewSystem`: all linear combinations of some screws, its class, and its description as text.

The twists that a body can have, and the wrenches that constraints support, are linear subspaces of the screws. C. G.
Gibson and K. H. Hunt, "Geometry of screw systems", Mechanism and Machine Theory 25, 1990, classify them by what no
rigid motion changes: the order n (dimension); the type, II if all screws with a finite pitch have the same pitch, else
I; and the letter A, B, C or D for 0, 1, 2 or 3 independent screws with infinite pitch (translations, couples). Orders 4
and 5 are classified by the reciprocal system, of order 6 - n.

A system of k directions and d translations has the matrix B of the products v.w of unit directions w: its symmetric
part has the principal pitches as eigenvalues, its antisymmetric part is the point through which the principal axes go.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from cinegen.arrays import Array
from cinegen.singularities.pluecker import KLEIN, LineAtInfinity, LineFrame, Screw, sense
from cinegen.singularities.reason import GeometryWriter

_NO_PITCH = 1e-9  # characteristic lengths


class ScrewSystem:
    """A linear subspace of screws.

    Args:
        vectors: (order, 6) independent screws (w, v) in the frame, dimensionless.
        frame: origin and characteristic length of these numbers.
        known: accuracy of the subspace, rad; smaller differences, of pitches too, count as zero.
        wrenches: whether they are wrenches (force, couple), not twists.

    Attributes:
        order: dimension, 0 to 6.
        frame, known, wrenches: as given.
    """

    def __init__(self, vectors: Array, frame: LineFrame, known: float, wrenches: bool = False) -> None:
        self.order, self.frame, self.wrenches, self.known = len(vectors), frame, wrenches, known
        basis = np.linalg.svd(vectors, full_matrices=False)[2] if self.order else np.zeros((0, 6))
        u, sigma, _ = np.linalg.svd(basis[:, :3])
        k = int((sigma > known).sum())
        self._translations = _oriented(_orthonormal((u[:, k:].T @ basis)[:, 3:]))  # (d, 3)
        rows = (u[:, :k].T @ basis) / sigma[:k, None]  # directions are orthonormal
        rows[:, 3:] -= rows[:, 3:] @ self._translations.T @ self._translations
        products = rows[:, 3:] @ rows[:, :3].T
        self._pitches, turn = np.linalg.eigh(0.5 * (products + products.T))
        rows = turn.T @ rows
        rows = _oriented(rows)
        self._axes, self._centre = rows, _centre(rows)
        self._slack = known * (1.0 + float(np.linalg.norm(self._centre)))
        self._is_perpendicular = True
        for row, shared in zip(rows, rows[:, :3] @ self._translations.T @ self._translations, strict=True):
            if np.linalg.norm(shared) > known:  # parallel screws have different pitches: the rotation is one of them
                self._is_perpendicular = False
                row[3:] -= row[:3] @ row[3:] / (shared @ shared) * shared
        if not self._is_perpendicular:
            self._pitches = (rows[:, :3] * rows[:, 3:]).sum(axis=1)
        self._pitches[np.abs(self._pitches) <= self._slack] = 0.0

    def __len__(self) -> int:
        return self.order

    def __repr__(self) -> str:
        return f"<ScrewSystem of order {self.order}{self.type and f', type {self.type}'}: {self.text()}>"

    @cached_property
    def screws(self) -> tuple[Screw, ...]:
        """A basis in the world, m: principal screws, which have perpendicular axes, then translations."""
        principal = [self._screw(row, pitch) for row, pitch in zip(self._axes, self._pitches, strict=True)]
        return (*principal, *(Screw(LineAtInfinity(t), np.inf) for t in self._translations))

    @property
    def coordinates(self) -> Array:
        """(order, 6) the coordinates of `screws`."""
        return np.array([screw.coordinates for screw in self.screws]).reshape(-1, 6)

    @property
    def vectors(self) -> Array:
        """(order, 6) the screws in the frame, dimensionless."""
        return np.vstack([self._axes, np.hstack([np.zeros_like(self._translations), self._translations])])

    @cached_property
    def reciprocal(self) -> ScrewSystem:
        """The wrenches that do no work on these twists, or the twists on which these wrenches do none."""
        vectors = np.linalg.svd(self.vectors @ KLEIN)[2][self.order :] if self.order else np.eye(6)
        return ScrewSystem(vectors, self.frame, self.known, not self.wrenches)

    @property
    def type(self) -> str:
        """Type of Gibson and Hunt, such as "IIA"; of order 4 and 5 that of the reciprocal system; empty for 0 and 6."""
        if self.order in (0, 6):
            return ""
        if self.order > 3:
            return self.reciprocal.type
        return ("II" if self._is_perpendicular and self._is_uniform else "I") + "ABCD"[len(self._translations)]

    @property
    def _is_uniform(self) -> bool:
        return bool(np.ptp(self._pitches) <= self._slack) if len(self._pitches) else True

    def _screw(self, row: Array, pitch: float) -> Screw:
        screw = self.frame.screw(row, 0.0, rotates=True)
        return Screw(screw.axis, self.frame.length * float(pitch))

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: m and rad."""
        return {"order": self.order, "type": self.type, "text": self.text(), "screws": self.coordinates.tolist()}

    # --- text ---------------------------------------------------------------------------------------------------------

    def text(self) -> str:
        """Return a description, such as "any rotation about the point (0.1, 0, 0.3) m"; lengths in the user's unit."""
        if self.order == 0:
            return "no wrench" if self.wrenches else "no motion"
        if self.order == 1:
            return screw_text(self.screws[0], self.frame.length, self.wrenches)
        return self._simple() or self._combination()

    def complement_text(self) -> str:
        """Return a description of as many wrenches as the order, of which each combination does work on one of these
        twists: couples about the directions of rotation, forces along the translations. Of wrenches, return one of
        twists on which they do work."""
        write, words = GeometryWriter("m", self.frame.length), _TWIST if self.wrenches else _WRENCH
        parts = []
        for vectors, phrases in ((self._axes[:, :3], words.infinite), (self._translations, words.straight)):
            if len(vectors):
                parts.append(phrases[len(vectors) - 1].format(write.along(_sole(vectors)) if len(vectors) < 3 else ""))
        return " and ".join(parts)

    def _simple(self) -> str | None:
        """Return the description of a system that has a short one; None for the others."""
        words = _WRENCH if self.wrenches else _TWIST
        (k, d), write = (len(self._axes), len(self._translations)), GeometryWriter("m", self.frame.length)
        axes, any_along, any_normal = self._axes[:, :3], *words.infinite[2:0:-1]
        if self.order == 6:
            return words.all
        if d == 3:
            which = (
                (f", and {words.any_line} {'parallel' if k == 1 else 'normal'} to {write.along(_sole(axes))}")
                if k
                else ""
            )
            return any_along + which
        if d == 2 and k == 0:
            return any_normal.format(write.along(_sole(self._translations)))
        if self.order > 3:
            return None
        if (k, d) == (1, 1) and np.linalg.norm(np.cross(axes[0], self._translations[0])) <= self.known:
            return words.coaxial.format(write.line(self.screws[0].axis))
        if not (self._is_perpendicular and self._is_uniform):
            return None
        pitch = self.frame.length * float(self._pitches[0])
        line = words.any_screw.format(write.pitch(pitch, self.wrenches)) if pitch else words.any_line
        point = write.position(self.frame.origin + self.frame.length * self._centre)
        if (k, d) == (3, 0):
            return words.any_through.format(point) if not pitch else f"{line} through the point {point}"
        if (k, d) == (2, 0):
            return f"{line} through the point {point} in the plane normal to {write.along(_sole(axes))}"
        normal = _sole(self._translations)
        if (k, d) == (1, 2):
            return f"{any_normal.format(write.along(normal))}, and {line} parallel to it"
        plane = write.plane(self.frame.plane(np.append(normal, normal @ self._centre)))
        along = f"parallel to {write.along(axes[0])} " if k == 1 else ""
        return f"{line} {along}in the plane {plane}, and {words.infinite[0].format('its normal')}"

    def _combination(self) -> str:
        """Return a description by a basis, or by the reciprocal system where that is smaller."""
        if self.order > 3:
            other = self.reciprocal.text()
            return (
                f"any wrench that does no work on {other}"
                if self.wrenches
                else f"any motion on which no work is done by {other}"
            )
        screws, length = self.screws, self.frame.length
        if (len(self._axes), self.order) == (2, 2) and self._pitches.prod() < 0.0:  # two lines span it
            parts = np.sqrt(np.abs(self._pitches[::-1]))
            rows = [parts @ self._axes, parts * [1.0, -1.0] @ self._axes]
            screws = tuple(self.frame.screw(row, 0.0, rotates=True) for row in rows)
        texts = [screw_text(screw, length, self.wrenches) for screw in screws]
        for k in (0, 1) if len(self._axes) == 3 else ():
            if abs(self._pitches[k + 1] - self._pitches[k]) <= self._slack:  # no two axes of a pencil are principal
                pencil = ScrewSystem(self._axes[k : k + 2], self.frame, self.known, self.wrenches)
                texts[k : k + 2] = [pencil.text().replace("any", "a", 1)]
        return f"any combination of {', '.join(texts[:-1])} and {texts[-1]}"


class _Words(NamedTuple):
    """Phrases about twists, or about wrenches.

    Attributes:
        all: every one.
        any_line: those without pitch.
        any_screw: those of a pitch.
        any_through: those without pitch, through a point.
        coaxial: those of any pitch about one axis.
        infinite: those of infinite pitch: along one direction, normal to one, any.
        straight: those without pitch, through any point: likewise.
    """

    all: str
    any_line: str
    any_screw: str
    any_through: str
    coaxial: str
    infinite: tuple[str, str, str]
    straight: tuple[str, str, str]


_TWIST = _Words(
    "any motion", "any rotation about an axis", "any screw of pitch {} about an axis",
    "any rotation about the point {}", "any rotation about, and any translation along, {}",
    ("a translation along {}", "any translation normal to {}", "any translation"),
    ("a rotation about an axis along {}", "any rotation about an axis normal to {}", "any rotation"),
)  # fmt: skip
_WRENCH = _Words(
    "any wrench", "any force along a line", "any wrench of pitch {} about an axis", "any force through the point {}",
    "any force along, and any couple about, {}",
    ("a couple about {}", "any couple about an axis normal to {}", "any couple"),
    ("a force along {}", "any force normal to {}", "any force"),
)  # fmt: skip


def screw_text(screw: Screw, length: float, wrench: bool = False) -> str:
    """Return a description of a twist, or of a wrench, in the user's unit of length.

    Args:
        screw: in the world, m.
        length: the characteristic length, m: it determines the number of digits.
        wrench: whether it is a wrench.
    """
    write = GeometryWriter("m", length)
    if isinstance(screw.axis, LineAtInfinity):
        return (_WRENCH if wrench else _TWIST).infinite[0].format(write.along(screw.axis.normal))
    where = f"through {write.position(screw.axis.nearest(np.zeros(3)))} along {write.along(screw.axis.direction)}"
    if abs(screw.pitch) < _NO_PITCH * length:
        return f"a force {where}" if wrench else f"a rotation about the axis {where}"
    return f"a {'wrench' if wrench else 'screw'} of pitch {write.pitch(screw.pitch, wrench)} about the axis {where}"


def _orthonormal(rows: Array) -> Array:
    return np.asarray(np.linalg.svd(rows, full_matrices=False)[2]) if len(rows) else rows


def _oriented(rows: Array) -> Array:
    """Return rows whose first three numbers mean the same with the opposite sign, the largest of these positive."""
    return np.asarray(rows * np.array([sense(row[:3]) for row in rows]).reshape(-1, 1))


def _sole(vectors: Array) -> Array:
    """Return the one direction (3,), or the normal of two; its largest component is positive."""
    direction = vectors[0] if len(vectors) == 1 else np.cross(vectors[0], vectors[1])
    return np.asarray(sense(direction) * direction)


def _centre(rows: Array) -> Array:
    """Return the point (3,) through which principal screws (k, 6) go, k of at most three perpendicular unit directions.

    With v = h w + p x w: p.(a x b) is the antisymmetric part of the products v.w for directions a and b. Of two, p.a
    and p.b follow from the components of v along their normal; of one, p is the nearest point of the axis.
    """
    w, v = rows[:, :3], rows[:, 3:]
    if len(rows) == 3:
        return np.asarray(0.5 * np.cross(w, v).sum(axis=0))
    if len(rows) == 2:
        normal = np.cross(w[0], w[1])
        return np.asarray((v[1] @ normal) * w[0] - (v[0] @ normal) * w[1] + 0.5 * (v[0] @ w[1] - v[1] @ w[0]) * normal)
    return np.asarray(np.cross(w, v).sum(axis=0))
