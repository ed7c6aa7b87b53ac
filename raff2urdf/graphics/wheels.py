"""Draw couplings as what imposes them: gear wheels, belts on pulleys, racks, screws.

A coupling of revolute joints is one of two wheels on a common carrier, whose angles relative to it are proportional.
Wheels with parallel axes are spur gears; their pitch radii follow from the distance and the ratio. Those that turn the
same way are a pinion in a ring of the body that bears the carrier, or else pulleys with a belt; so are those that are
far apart, or that the file names so. Wheels whose axes meet are bevel gears. A `radius` is that of a pinion, and the
lead of a screw is the length of each of its turns. Other couplings have no such form, and are not drawn.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.graphics.skeleton import JOINT
from raff2urdf.graphics.solids import MOST_TEETH, possible_teeth, recipe, tooth_numbers
from raff2urdf.placement import along, inverse
from raff2urdf.raff.document import DriveKind, JointType, RaffCoupling, RaffLink
from raff2urdf.tree import home, placements

if TYPE_CHECKING:
    from raff2urdf.graphics.bodies import BodyDrawing
    from raff2urdf.graphics.body_shapes import Colour, DrawnBody


_BELT = re.compile("belt|chain|cable|tendon|strap|rope", re.IGNORECASE)
_FAR = 40.0  # units: distance of axes beyond which a belt connects them
_ABOVE = 2.1  # units: of wheels above the middle of their joint
_LARGEST = 1e4  # units: of wheels that are drawn, and of distances between them
_HALF = 0.5  # units: of the thickness of wheels
_MOST_TURNS = 40  # of a screw that are drawn
_NUT = recipe("lathe", 6, 0.0, -1.0, 1.0, -1.0, 1.0, 1.0, 0.0, 1.0)


class Wheel(NamedTuple):
    """A body that turns about an axis of its carrier.

    Attributes:
        body: the body.
        axis: placement (4, 4) in the world at home whose z is the axis.
        turns: its angle relative to the carrier, as coefficients of joint variables by the link's number.
        bears: whether the body bears the carrier.
    """

    body: DrawnBody
    axis: Array
    turns: Mapping[int, float]
    bears: bool = False


class Mesh(NamedTuple):
    """Two wheels in contact.

    Attributes:
        kind: spur, ring, belt, crossed or bevel.
        radii: pitch radii of both, m.
        centres: of both pitch circles in the world at home (3,).
        axes: of both (3,), in the directions in which `ratio` counts.
        ratio: angle of the first for 1 of the second, relative to the carrier.
    """

    kind: str
    wheels: tuple[Wheel, Wheel]
    radii: tuple[float, float]
    centres: tuple[Array, Array]
    axes: tuple[Array, Array]
    ratio: float


class CouplingDrawing:
    """The couplings of a robot, drawn onto its bodies.

    Args:
        bodies: of the robot.
    """

    def __init__(self, bodies: BodyDrawing) -> None:
        self.bodies, self.robot, self.unit = bodies, bodies.robot, bodies.unit
        self.world = placements(bodies.document, bodies.robot)
        self._teeth: dict[tuple[int, ...], tuple[int, Array]] = {}  # of wheels: their number, and where one is

    def draw(self) -> None:
        """Draw all couplings."""
        for coupling in self.robot.couplings:
            for mesh in self.meshes(coupling):
                self._draw_mesh(mesh, self.bodies.bodies[self._link(coupling.follower).pred])
            for drive in coupling.drives:
                ends = self._link(coupling.follower), self._link(drive.link)
                slide, turning = ends if ends[0].type is JointType.PRISMATIC else ends[::-1]
                length = self.bodies.document.metres(drive.numbers[0])
                if not length:
                    continue
                if drive.kind is DriveKind.RADIUS:
                    self._rack(slide, turning, length, bool(_BELT.search(coupling.name or "")))
                elif drive.kind is DriveKind.LEAD:
                    self._screw(slide, turning, length, len(coupling.drives) > 1)

    def _link(self, number: int) -> RaffLink:
        link = self.robot.nodes[number]
        assert isinstance(link, RaffLink)
        return link

    # --- wheels -----------------------------------------------------------------------------------------------------

    def meshes(self, coupling: RaffCoupling) -> Iterator[Mesh]:
        """Yield the pairs of wheels that impose a coupling of revolute joints."""
        first = self._link(coupling.follower)
        if first.type is not JointType.REVOLUTE or any(drive.kind is not DriveKind.RATIO for drive in coupling.drives):
            return
        wheel = Wheel(self.bodies.bodies[first.number], self.world[first.number], {first.number: 1.0})
        others = list(self._on_carrier(first))
        is_belt = bool(_BELT.search(coupling.name or ""))
        for other in others:
            ratio = self._ratio(wheel, other, [coupling])
            mesh = None if ratio is None else self._spur(wheel, other, ratio, is_belt)
            if mesh is not None:
                yield mesh
                return
        for other in others:
            ratio = self._ratio(wheel, other, self.robot.couplings)
            mesh = None if ratio is None else self._bevel(wheel, other, ratio)
            if mesh is not None:
                yield mesh

    def _on_carrier(self, link: RaffLink) -> Iterator[Wheel]:
        """Yield what turns about an axis of the body on which a link turns."""
        carrier = self.bodies.bodies[link.pred]
        turning = [each for each in self.robot.links if each.type is JointType.REVOLUTE and each is not link]
        for each in turning:
            if self.bodies.bodies[each.pred] is carrier:
                yield Wheel(self.bodies.bodies[each.number], self.world[each.number], {each.number: 1.0})
        for inner in turning:
            if self.bodies.bodies[inner.number] is not carrier:
                continue
            bearer, axis = self.bodies.bodies[inner.pred], self.world[inner.number]
            yield Wheel(bearer, axis, {inner.number: -1.0}, bears=True)
            for each in turning:
                if (
                    each is not inner
                    and self.bodies.bodies[each.pred] is bearer
                    and self._coaxial(axis, self.world[each.number])
                ):
                    same = math.copysign(1.0, axis[:3, 2] @ self.world[each.number][:3, 2])
                    yield Wheel(self.bodies.bodies[each.number], axis, {each.number: same, inner.number: -1.0})

    def _coaxial(self, first: Array, other: Array) -> bool:
        apart = other[:3, 3] - first[:3, 3]
        parallel = abs(first[:3, 2] @ other[:3, 2]) > 1.0 - 1e-9
        return bool(parallel and np.linalg.norm(np.cross(apart, first[:3, 2])) < 1e-3 * self.unit)

    def _ratio(self, first: Wheel, other: Wheel, couplings: Sequence[RaffCoupling]) -> float | None:
        """Return how far a wheel turns for 1 of another one as couplings demand; None if they leave that open."""
        numbers = [link.number for link in self.robot.links]
        rows = []
        for coupling in couplings:
            if all(drive.kind is DriveKind.RATIO for drive in coupling.drives):
                terms = {coupling.follower: -1.0}
                for drive in coupling.drives:
                    terms[drive.link] = terms.get(drive.link, 0.0) + drive.numbers[0]
                rows.append([terms.get(number, 0.0) for number in numbers])
        ends = np.array([[wheel.turns.get(number, 0.0) for number in numbers] for wheel in (first, other)])
        basis = np.array([ends[1], *rows]).T
        if np.linalg.matrix_rank(basis) < basis.shape[1]:
            return None
        solution = np.linalg.lstsq(basis, ends[0], rcond=None)[0]
        fits = np.abs(basis @ solution - ends[0]).max() < 1e-9 * max(1.0, float(np.abs(solution).max()))
        return float(solution[0]) if fits and abs(solution[0]) > 1e-3 else None

    def _spur(self, wheel: Wheel, other: Wheel, ratio: float, is_belt: bool) -> Mesh | None:
        z, origin = wheel.axis[:3, 2], wheel.axis[:3, 3] + _ABOVE * self.unit * wheel.axis[:3, 2]
        along = float(z @ other.axis[:3, 2])
        if abs(along) < 1.0 - 1e-6:
            return None
        foot = other.axis[:3, 3] + z * (z @ (origin - other.axis[:3, 3]))
        ratio *= math.copysign(1.0, along)
        distance, k = float(np.linalg.norm(foot - origin)), abs(ratio)
        if not 2.0 * self.unit < distance < _LARGEST * self.unit:
            return None
        is_ring = ratio > 0.0 and other.bears and distance * k < 4.0 * _FAR * self.unit * (k - 1.0)
        if is_belt or distance > _FAR * self.unit or (ratio > 0.0 and not is_ring):
            kind = "belt" if ratio > 0.0 else "crossed"
            whole = min(0.8 * distance, 7.0 * self.unit * (1.0 + min(k, 1.0 / k)))
            radii = whole / (1.0 + k), whole * k / (1.0 + k)
        elif is_ring:
            kind, radii = "ring", (distance / (k - 1.0), distance * k / (k - 1.0))
        else:
            kind, radii = "spur", (distance / (1.0 + k), distance * k / (1.0 + k))
        return Mesh(kind, (wheel, other), radii, (origin, foot), (z, z), ratio)

    def _bevel(self, wheel: Wheel, other: Wheel, ratio: float) -> Mesh | None:
        z, axis, apart = wheel.axis[:3, 2], other.axis[:3, 2], other.axis[:3, 3] - wheel.axis[:3, 3]
        if abs(z @ axis) > 1e-6 or abs(apart @ np.cross(z, axis)) > 1e-3 * self.unit:
            return None
        apex = wheel.axis[:3, 3] + z * (z @ apart)
        ahead = sum(float(placed[2, 3]) for placed in wheel.body.nodes.values())
        high = math.copysign(4.2 * self.unit * min(1.0, abs(ratio)), ahead or 1.0)
        aside = -high / ratio  # both have the same velocity where they touch
        centres = apex + high * z, apex + aside * axis
        return Mesh("bevel", (wheel, other), (abs(aside), abs(high)), centres, (z, axis), ratio)

    def _draw_mesh(self, mesh: Mesh, carrier: DrawnBody) -> None:
        if mesh.kind == "bevel":
            self._draw_bevel(mesh)
            return
        ends = list(zip(mesh.wheels, mesh.radii, mesh.centres, strict=True))
        z, apart = mesh.axes[0], mesh.centres[1] - mesh.centres[0]
        x = apart / np.linalg.norm(apart) * (-1.0 if mesh.kind == "ring" else 1.0)  # to where they touch
        y = np.cross(z, x)
        known = [self._teeth.get(self._key(wheel, radius)) for wheel, radius, _ in ends]
        teeth = tooth_numbers(mesh.ratio)
        for radius, known_teeth in zip(mesh.radii, known, strict=True):
            if known_teeth is not None:
                teeth = (
                    possible_teeth(known_teeth[0] * mesh.radii[0] / radius),
                    possible_teeth(known_teeth[0] * mesh.radii[1] / radius),
                )
        # Pitches from a tooth to where they touch: a tooth of one is in a gap of the other.
        contact, sign = ((0.0, math.pi), 1.0) if mesh.kind == "spur" else ((0.0, 0.0), -1.0)
        phases = [
            None
            if known_teeth is None
            else (contact[i] - math.atan2(y @ known_teeth[1], x @ known_teeth[1])) * teeth[i] / math.tau
            for i, known_teeth in enumerate(known)
        ]
        first = phases[0] if phases[0] is not None else 0.0 if phases[1] is None else sign * (0.5 - phases[1])
        for i, (phase, (wheel, radius, centre)) in enumerate(zip((first, 0.5 - sign * first), ends, strict=True)):
            if known[i] is None:
                angle = contact[i] - math.tau * phase / teeth[i]
                tooth = x * math.cos(angle) + y * math.sin(angle)
                self._teeth[self._key(wheel, radius)] = teeth[i], tooth
                self._wheel(wheel.body, teeth[i], radius, centre, z, tooth, is_ring=i == 1 and mesh.kind == "ring")
        if mesh.kind in ("belt", "crossed"):
            self._belt(carrier, mesh.centres, mesh.radii, teeth, z, mesh.kind == "crossed")

    def _draw_bevel(self, mesh: Mesh) -> None:
        apex = mesh.centres[0] + mesh.axes[0] * (mesh.axes[0] @ (mesh.centres[1] - mesh.centres[0]))
        for i, count in enumerate(tooth_numbers(mesh.ratio)):
            centre, radius, height = mesh.centres[i], mesh.radii[i], mesh.radii[1 - i]
            z, x = (apex - centre) / height, (mesh.centres[1 - i] - apex) / radius
            angle = math.pi * i / count
            tooth = x * math.cos(angle) + np.cross(z, x) * math.sin(angle)
            text = recipe("bevel", count, height / radius, 0.3)
            self._place(mesh.wheels[i].body, text, (radius,) * 3, centre, z, tooth)

    def _wheel(
        self, body: DrawnBody, teeth: int, radius: float, centre: Array, z: Array, tooth: Array, is_ring: bool = False
    ) -> None:
        u, scale = self.unit, (radius, radius, _HALF * self.unit)
        if is_ring:
            self._place(body, recipe("ring", teeth, 1.0, 1.0 + 5.0 / teeth + 0.8 * u / radius), scale, centre, z, tooth)
            return
        self._place(body, recipe("wheel", teeth, 1.0), scale, centre, z, tooth)
        hub = min(0.9 * u, 0.6 * radius)
        self._cylinder(body, hub, centre - _ABOVE * u * z, centre + 1.3 * _HALF * u * z)
        self._cylinder(body, 0.5 * hub, centre, centre + 1.7 * _HALF * u * z, JOINT)

    def _belt(
        self,
        carrier: DrawnBody,
        centres: Sequence[Array],
        radii: Sequence[float],
        teeth: Sequence[int],
        z: Array,
        is_crossed: bool = False,
    ) -> None:
        u, apart = self.unit, centres[1] - centres[0]
        outer = [radius * (1.0 + 1.8 / count) / u for radius, count in zip(radii, teeth, strict=True)]
        text = recipe("belt", float(np.linalg.norm(apart)) / u, *outer, 0.25, 0.8 * _HALF, float(is_crossed))
        self._place(carrier, text, (u, u, u), centres[0], z, apart, JOINT)

    def _key(self, wheel: Wheel, radius: float) -> tuple[int, ...]:
        at = inverse(self._home_of(wheel.body)) @ wheel.axis[:, 3] / self.unit
        return id(wheel.body), round(20.0 * radius / self.unit), *np.round(at[:3]).astype(int).tolist()

    # --- racks and screws -------------------------------------------------------------------------------------------

    def _rack(self, slide: RaffLink, turning: RaffLink, radius: float, is_belt: bool) -> None:
        """Draw a pinion, and the rack on what slides or a belt to the other end of its stroke, if they can touch.

        All in the world at home, m. The pinion turns about z. At `contact`, where its pitch circle touches the rack, it
        moves along `feed`, as the link of the prismatic joint does. They can touch if z and `feed` are perpendicular,
        and the joints are on one body. The rack covers the stroke, and three teeth more on both sides.

        Args:
            slide: link of the prismatic joint, along the z axis of its frame.
            turning: link of the pinion's joint.
            radius: pitch radius, m; negative if the link moves against its axis as the pinion's angle increases.
            is_belt: draw a belt over an idler instead of a rack.
        """
        u, axis, rail = self.unit, self.world[turning.number], self.world[slide.number]
        z, feed, bodies = axis[:3, 2], rail[:3, 2] * math.copysign(1.0, radius), self.bodies.bodies
        radius = abs(radius)
        if not 0.1 * u < radius < _LARGEST * u:
            return
        teeth = min(max(round(math.tau * radius / (1.2 * u)), 12), 80)
        level = float(z @ (rail[:3, 3] - axis[:3, 3]))
        centre = axis[:3, 3] + z * (level if abs(level) > _ABOVE * u else math.copysign(_ABOVE * u, level))
        aside = np.cross(feed, z)  # from the axis to where the pinion drives along `feed`
        touches = abs(z @ feed) < 1e-6 and bodies[slide.pred] is bodies[turning.pred]
        tooth = aside if touches else axis[:3, 0]
        self._place(bodies[turning.number], recipe("wheel", teeth, _HALF * u / radius), (radius,) * 3, centre, z, tooth)
        self._cylinder(bodies[turning.number], min(0.8 * u, 0.6 * radius), axis[:3, 3], centre + 0.8 * u * z)
        if not touches:
            return
        now, (low, high) = home(self.bodies.document, slide), self.bodies.skeleton.stroke(slide)
        low, high = sorted(float(feed @ rail[:3, 2]) * (value - now) for value in (low, high))  # from home along `feed`
        ahead = float(feed @ (centre - rail[:3, 3]))  # from what slides to the pinion
        contact = centre + radius * aside
        if is_belt:
            end = max((low - ahead, high - ahead), key=abs)
            if abs(end) > _LARGEST * u:
                return
            idler = centre + math.copysign(abs(end) + radius + 4.0 * u, end) * feed
            self._belt(bodies[slide.pred], (centre, idler), (radius, radius), (teeth, teeth), z)
            self._cylinder(bodies[slide.pred], 0.95 * radius, idler - 0.8 * _HALF * u * z, idler + 0.8 * _HALF * u * z)
            self._bracket(bodies[slide.number], rail[:3, 3], contact - ahead * feed)
            return
        pitch = math.tau * radius / teeth
        reach = (low / pitch - 3.0, high / pitch + 3.0)  # of the contact on the rack, backwards, in pitches
        count, middle = 2 * math.ceil(0.5 * (reach[1] - reach[0])), -round(0.5 * (reach[0] + reach[1])) * pitch
        if count > MOST_TEETH:
            return
        text = recipe("rack", count, pitch / u, _HALF, 0.9)
        self._place(bodies[slide.number], text, (u, u, u), contact + middle * feed, np.cross(feed, aside), -feed)
        self._bracket(bodies[slide.number], rail[:3, 3], contact + 0.6 * u * aside - ahead * feed)

    def _screw(self, slide: RaffLink, turning: RaffLink, lead: float, turns_nut: bool) -> None:
        """Draw a screw that turns, with its nut on what slides; or a nut that turns on the sliding shaft."""
        u, axis, rail = self.unit, self.world[turning.number], self.world[slide.number]
        z, body, moving = rail[:3, 2], self.bodies.bodies[turning.number], self.bodies.bodies[slide.number]
        if abs(axis[:3, 2] @ z) < 1.0 - 1e-6:
            return
        if turns_nut:
            if self._coaxial(axis, rail):
                at = axis[:3, 3] + math.copysign(1.3 * u, lead) * z
                self._place(body, _NUT, (1.9 * u, 1.9 * u, 0.9 * u), at, z, axis[:3, 0])
                self.bodies.threads[slide.number] = abs(lead)
            return
        now, (low, high) = home(self.bodies.document, slide), self.bodies.skeleton.stroke(slide)
        nut, length = axis[:3, 3] + z * (z @ (rail[:3, 3] - axis[:3, 3])), high - low + 6.0 * u
        turns = math.copysign(min(length / abs(lead), _MOST_TURNS), lead * (z @ axis[:3, 2]))
        start = nut + (low - now - 3.0 * u) * z
        self._place(body, recipe("screw", turns, 0.3), (0.85 * u, 0.85 * u, length), start, z, axis[:3, 0])
        self._place(moving, _NUT, (1.7 * u, 1.7 * u, u), nut, z, axis[:3, 0])
        self._bracket(moving, rail[:3, 3], nut)

    # --- shapes, in the world at home -------------------------------------------------------------------------------

    def _home_of(self, body: DrawnBody) -> Array:
        return self.world[next(iter(body.nodes))]

    def _place(
        self,
        body: DrawnBody,
        text: str,
        scale: tuple[float, ...],
        centre: Array,
        z: Array,
        x: Array,
        colour: Colour | None = None,
    ) -> None:
        x = x - z * (z @ x)
        x = x / np.linalg.norm(x)
        placement = np.eye(4)
        placement[:3, :3], placement[:3, 3] = np.column_stack([x, np.cross(z, x), z]), centre
        self.bodies.add(body, ("mesh", scale, inverse(self._home_of(body)) @ placement, text), colour)

    def _cylinder(self, body: DrawnBody, radius: float, start: Array, end: Array, colour: Colour | None = None) -> None:
        place = inverse(self._home_of(body)) @ along(0.5 * (start + end), end - start)
        self.bodies.add(body, ("cylinder", (radius, float(np.linalg.norm(end - start))), place, ""), colour)

    def _bracket(self, body: DrawnBody, start: Array, end: Array) -> None:
        if np.linalg.norm(end - start) > self.unit:
            self._cylinder(body, 0.5 * self.unit, start, end)
