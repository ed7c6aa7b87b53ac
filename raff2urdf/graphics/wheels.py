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
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raff2urdf.graphics.skeleton import JOINT
from raff2urdf.graphics.solids import recipe, tooth_numbers
from raff2urdf.placement import inverse
from raff2urdf.raff.document import DriveKind, JointType, RaffCoupling, RaffLink
from raff2urdf.tree import placements

if TYPE_CHECKING:
    from raff2urdf.graphics.bodies import Body, BodyDrawing

Array = NDArray[np.float64]

_BELT = re.compile("belt|chain|cable|tendon|strap|rope", re.IGNORECASE)
_FAR = 40.0  # units: distance of axes beyond which a belt connects them
_ABOVE = 2.1  # units: of wheels above the middle of their joint
_HALF = 0.5  # units: of the thickness of wheels
_MOST_TURNS = 40  # of a screw that are drawn


class Wheel(NamedTuple):
    """A body that turns about an axis of its carrier.

    Attributes:
        body: the body.
        axis: placement (4, 4) in the world at home whose z is the axis.
        turns: its angle relative to the carrier, as coefficients of joint variables by the link's number.
        bears: whether the body bears the carrier.
    """

    body: Body
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
        self._teeth: dict[tuple[int, ...], tuple[int, float]] = {}  # of wheels: teeth, and angle of one of them

    def draw(self) -> None:
        """Draw all couplings."""
        for coupling in self.robot.couplings:
            kinds = {drive.kind for drive in coupling.drives}
            if kinds == {DriveKind.RATIO}:
                for mesh in self.meshes(coupling):
                    self._draw_mesh(mesh, self.bodies.bodies[self._link(coupling.follower).pred])
            for drive in coupling.drives:
                ends = self._link(coupling.follower), self._link(drive.link)
                slides = [link for link in ends if link.type is JointType.PRISMATIC]
                if len(slides) == 1 and drive.kind in (DriveKind.RADIUS, DriveKind.LEAD):
                    turning = ends[0] if slides[0] is ends[1] else ends[1]
                    length = self.bodies.document.metres(drive.numbers[0])
                    if drive.kind is DriveKind.RADIUS:
                        self._rack(slides[0], turning, length, bool(_BELT.search(coupling.name or "")))
                    else:
                        self._screw(slides[0], turning, length, len(coupling.drives) > 1)

    def _link(self, number: int) -> RaffLink:
        link = self.robot.nodes[number]
        assert isinstance(link, RaffLink)
        return link

    # --- wheels -----------------------------------------------------------------------------------------------------

    def meshes(self, coupling: RaffCoupling) -> Iterator[Mesh]:
        """Yield the pairs of wheels that impose a coupling of revolute joints."""
        first = self._link(coupling.follower)
        if first.type is not JointType.REVOLUTE:
            return
        own = Wheel(self.bodies.bodies[first.number], self.world[first.number], {first.number: 1.0})
        others = list(self._on_carrier(first))
        is_belt = bool(_BELT.search(coupling.name or ""))
        for other in others:
            ratio = self._ratio(own, other, [coupling])
            mesh = None if ratio is None else self._spur(own, other, ratio, is_belt)
            if mesh is not None:
                yield mesh
                return
        for other in others:
            ratio = self._ratio(own, other, self.robot.couplings)
            mesh = None if ratio is None else self._bevel(own, other, ratio)
            if mesh is not None:
                yield mesh

    def _on_carrier(self, link: RaffLink) -> Iterator[Wheel]:
        """Yield what turns about an axis of the body on which a link turns."""
        carrier = self.bodies.bodies[link.pred]
        turning = [one for one in self.robot.links if one.type is JointType.REVOLUTE and one is not link]
        for one in turning:
            if self.bodies.bodies[one.pred] is carrier:
                yield Wheel(self.bodies.bodies[one.number], self.world[one.number], {one.number: 1.0})
        for inner in turning:
            if self.bodies.bodies[inner.number] is not carrier:
                continue
            bearer, axis = self.bodies.bodies[inner.pred], self.world[inner.number]
            yield Wheel(bearer, axis, {inner.number: -1.0}, bears=True)
            for one in turning:
                if one is not inner and self.bodies.bodies[one.pred] is bearer and self._coaxial(axis, self.world[one.number]):
                    same = math.copysign(1.0, axis[:3, 2] @ self.world[one.number][:3, 2])
                    yield Wheel(self.bodies.bodies[one.number], axis, {one.number: same, inner.number: -1.0})

    def _coaxial(self, one: Array, other: Array) -> bool:
        apart = other[:3, 3] - one[:3, 3]
        parallel = abs(one[:3, 2] @ other[:3, 2]) > 1.0 - 1e-9
        return bool(parallel and np.linalg.norm(np.cross(apart, one[:3, 2])) < 1e-3 * self.unit)

    def _ratio(self, own: Wheel, other: Wheel, couplings: tuple[RaffCoupling, ...] | list[RaffCoupling]) -> float | None:
        """Return how far a wheel turns for 1 of another one as couplings demand; None if they leave that open."""
        numbers = [link.number for link in self.robot.links]
        rows = []
        for one in couplings:
            if all(drive.kind is DriveKind.RATIO for drive in one.drives):
                terms = {one.follower: -1.0}
                for drive in one.drives:
                    terms[drive.link] = terms.get(drive.link, 0.0) + drive.numbers[0]
                rows.append([terms.get(number, 0.0) for number in numbers])
        ends = np.array([[wheel.turns.get(number, 0.0) for number in numbers] for wheel in (own, other)])
        basis = np.array([ends[1], *rows]).T
        if np.linalg.matrix_rank(basis) < basis.shape[1]:
            return None
        found = np.linalg.lstsq(basis, ends[0], rcond=None)[0]
        fits = np.abs(basis @ found - ends[0]).max() < 1e-9 * max(1.0, float(np.abs(found).max()))
        return float(found[0]) if fits and abs(found[0]) > 1e-3 else None

    def _spur(self, own: Wheel, other: Wheel, ratio: float, is_belt: bool) -> Mesh | None:
        z, origin = own.axis[:3, 2], own.axis[:3, 3] + _ABOVE * self.unit * own.axis[:3, 2]
        along = float(z @ other.axis[:3, 2])
        if abs(along) < 1.0 - 1e-6:
            return None
        foot = other.axis[:3, 3] + z * (z @ (origin - other.axis[:3, 3]))
        ratio *= math.copysign(1.0, along)
        distance, k = float(np.linalg.norm(foot - origin)), abs(ratio)
        if distance < 2.0 * self.unit:
            return None
        if is_belt or distance > _FAR * self.unit or (ratio > 0.0 and not (other.bears and k > 1.0)):
            kind = "belt" if ratio > 0.0 else "crossed"
            whole = min(0.8 * distance, 7.0 * self.unit * (1.0 + min(k, 1.0 / k)))
            radii = whole / (1.0 + k), whole * k / (1.0 + k)
        elif ratio > 0.0:
            kind, radii = "ring", (distance / (k - 1.0), distance * k / (k - 1.0))
        else:
            kind, radii = "spur", (distance / (1.0 + k), distance * k / (1.0 + k))
        return Mesh(kind, (own, other), radii, (origin, foot), (z, z), ratio)

    def _bevel(self, own: Wheel, other: Wheel, ratio: float) -> Mesh | None:
        z, axis, apart = own.axis[:3, 2], other.axis[:3, 2], other.axis[:3, 3] - own.axis[:3, 3]
        if abs(z @ axis) > 1e-6 or abs(apart @ np.cross(z, axis)) > 1e-3 * self.unit:
            return None
        apex = own.axis[:3, 3] + z * (z @ apart)
        ahead = sum(float(placed[2, 3]) for placed in own.body.nodes.values())
        high = math.copysign(4.2 * self.unit * min(1.0, abs(ratio)), ahead or 1.0)
        aside = -high / ratio  # both have the same velocity where they touch
        centres = apex + high * z, apex + aside * axis
        return Mesh("bevel", (own, other), (abs(aside), abs(high)), centres, (z, axis), ratio)

    def _draw_mesh(self, mesh: Mesh, carrier: Body) -> None:
        u, (own, other), (near, far) = self.unit, mesh.wheels, mesh.radii
        teeth = list(tooth_numbers(mesh.ratio))
        towards = (mesh.centres[1] - mesh.centres[0]) / np.linalg.norm(mesh.centres[1] - mesh.centres[0])
        if mesh.kind == "bevel":
            apex = mesh.centres[0] + mesh.axes[0] * (mesh.axes[0] @ (mesh.centres[1] - mesh.centres[0]))
            for i, (wheel, radius) in enumerate(zip(mesh.wheels, mesh.radii, strict=True)):
                way = (apex - mesh.centres[i]) / mesh.radii[1 - i]
                aside = mesh.centres[1 - i] - apex
                shape = recipe("bevel", teeth[i], mesh.radii[1 - i] / radius, 0.3)
                self._put(wheel.body, shape, radius, radius, mesh.centres[i], way, aside, 0.5 * i, teeth[i])
            return
        if mesh.kind == "ring":
            towards = -towards
        known = [self._teeth.get(self._key(w, r)) for w, r in zip(mesh.wheels, mesh.radii, strict=True)]
        for i in (0, 1):
            if known[i] is not None:
                teeth = [round(known[i][0] * mesh.radii[j] / mesh.radii[i]) for j in (0, 1)]
        z, x = mesh.axes[0], towards
        frame = np.column_stack([x, np.cross(z, x), z])
        # Phases count from a tooth to the point of contact, in pitches; x points from the first wheel to it.
        backwards = -1.0 if mesh.kind == "spur" else 1.0
        phases: list[float | None] = [None, None]
        for i in (0, 1):
            if known[i] is not None:
                way = self._turned(wheel_angle := known[i][1], z)
                angle = math.atan2(frame[:, 1] @ way, frame[:, 0] @ way)
                at = math.pi if i and mesh.kind == "spur" else 0.0
                phases[i] = (at - angle) * teeth[i] / (2.0 * math.pi)
                del wheel_angle
        if phases[0] is None:
            phases[0] = 0.0 if phases[1] is None else backwards * (phases[1] - 0.5)
        if phases[1] is None:
            phases[1] = 0.5 + backwards * phases[0]
        for i, (wheel, radius) in enumerate(zip(mesh.wheels, mesh.radii, strict=True)):
            if known[i] is not None:
                continue
            at = math.pi if i and mesh.kind == "spur" else 0.0
            angle = at - 2.0 * math.pi * phases[i] / teeth[i]
            tooth = frame @ [math.cos(angle), math.sin(angle), 0.0]
            self._teeth[self._key(wheel, radius)] = teeth[i], self._angle(tooth, z)
            self._wheel(wheel.body, teeth[i], radius, mesh.centres[i], z, tooth, i == 1 and mesh.kind == "ring")
        if mesh.kind in ("belt", "crossed"):
            radii = [radius * (1.0 + 1.8 / n) / u for radius, n in zip(mesh.radii, teeth, strict=True)]
            length = float(np.linalg.norm(mesh.centres[1] - mesh.centres[0])) / u
            shape = recipe("belt", length, *radii, 0.25, 0.8 * _HALF, float(mesh.kind == "crossed"))
            self._place(carrier, shape, (u, u, u), mesh.centres[0], z, towards, JOINT)

    def _wheel(
        self, body: Body, teeth: int, radius: float, centre: Array, z: Array, tooth: Array, is_ring: bool = False
    ) -> None:
        u = self.unit
        if is_ring:
            shape = recipe("ring", teeth, 1.0, 1.0 + 5.0 / teeth + 0.8 * u / radius)
            self._place(body, shape, (radius, radius, _HALF * u), centre, z, tooth)
            return
        self._place(body, recipe("wheel", teeth, 1.0), (radius, radius, _HALF * u), centre, z, tooth)
        hub = min(0.9 * u, 0.6 * radius)
        self._cylinder(body, hub, centre - _ABOVE * u * z, centre + 1.3 * _HALF * u * z)
        self._cylinder(body, 0.5 * hub, centre, centre + 1.7 * _HALF * u * z, JOINT)

    def _key(self, wheel: Wheel, radius: float) -> tuple[int, ...]:
        where = inverse(self._home_of(wheel.body)) @ wheel.axis
        return (id(wheel.body), round(20.0 * radius / self.unit), *np.round(where[:3, 3] / self.unit).astype(int).tolist())

    def _angle(self, way: Array, z: Array) -> float:
        x, y = self._beside(z)
        return math.atan2(y @ way, x @ way)

    def _turned(self, angle: float, z: Array) -> Array:
        x, y = self._beside(z)
        return x * math.cos(angle) + y * math.sin(angle)

    def _beside(self, z: Array) -> tuple[Array, Array]:
        aside = np.eye(3)[int(np.abs(z).argmin())]
        x = np.cross(aside, z)
        x /= np.linalg.norm(x)
        return x, np.cross(z, x)

    # --- racks and screws -------------------------------------------------------------------------------------------

    def _rack(self, slide: RaffLink, turning: RaffLink, radius: float, is_belt: bool) -> None:
        u, axis, rail = self.unit, self.world[turning.number], self.world[slide.number]
        z, way = axis[:3, 2], rail[:3, 2] * math.copysign(1.0, radius)
        radius = abs(radius)
        teeth = min(max(round(math.tau * radius / (1.2 * u)), 12), 80)
        level = float(z @ (rail[:3, 3] - axis[:3, 3]))
        level = level if abs(level) > _ABOVE * u else math.copysign(_ABOVE * u, level)
        centre, aside = axis[:3, 3] + level * z, np.cross(way, z)
        body, moving = self.bodies.bodies[turning.number], self.bodies.bodies[slide.number]
        on_same = self.bodies.bodies[slide.pred] is self.bodies.bodies[turning.pred]
        self._wheel_on(body, teeth, radius, centre, axis, aside)
        if abs(z @ way) > 1e-6 or not on_same:
            return
        low, high = sorted(math.copysign(1.0, way @ rail[:3, 2]) * value for value in self.bodies.skeleton.stroke(slide))
        now = float(way @ (rail[:3, 3] - self._zero(slide)))
        ahead = float(way @ (centre - rail[:3, 3])) + now  # of the slide where its variable is 0
        if is_belt:
            ends = np.array([low, high]) - ahead
            reach = float(ends[np.abs(ends).argmax()])
            length = abs(reach) + radius + 4.0 * u
            shape = recipe("belt", length / u, *[radius * (1.0 + 1.8 / teeth) / u] * 2, 0.25, 0.8 * _HALF, 0.0)
            along = math.copysign(1.0, reach) * way
            carrier = self.bodies.bodies[slide.pred]
            self._place(carrier, shape, (u, u, u), centre, z, along, JOINT)
            self._cylinder(carrier, 0.95 * radius, centre + length * along - 0.4 * u * z, centre + length * along + 0.4 * u * z)
            at = centre + radius * aside + way * float(way @ (rail[:3, 3] - centre))
        else:
            pitch = math.tau * radius / teeth
            first, last = (ahead - high) / pitch - 3.0, (ahead - low) / pitch + 3.0
            count = math.ceil(last - first)
            middle = ahead - now + pitch * (round((0.5 * (first + last) * pitch - ahead + now) / pitch - 0.5) + 0.5)
            shape = recipe("rack", 2 * math.ceil(0.5 * count), pitch / u, _HALF, 0.9)
            at = rail[:3, 3] + way * (way @ (centre + radius * aside - rail[:3, 3]))
            at = centre + radius * aside + way * (middle - float(way @ (centre - rail[:3, 3])))
            self._place(moving, shape, (u, u, u), at, -z if False else np.cross(-way, aside), -way, None)
            at = at + aside * 0.6 * u
        self._bracket(moving, rail[:3, 3], at)

    def _zero(self, slide: RaffLink) -> Array:
        """Return where a slide is in the world if its variable is 0 (3,)."""
        from raff2urdf.tree import home

        at = self.world[slide.number]
        return np.asarray(at[:3, 3] - home(self.bodies.document, slide) * at[:3, 2])

    def _wheel_on(self, body: Body, teeth: int, radius: float, centre: Array, axis: Array, tooth: Array) -> None:
        z = axis[:3, 2]
        self._place(body, recipe("wheel", teeth, 1.0), (radius, radius, _HALF * self.unit), centre, z, tooth)
        self._cylinder(body, min(0.8 * self.unit, 0.6 * radius), axis[:3, 3], centre + 0.8 * self.unit * z)

    def _screw(self, slide: RaffLink, turning: RaffLink, lead: float, turns_nut: bool) -> None:
        u, axis, rail = self.unit, self.world[turning.number], self.world[slide.number]
        if abs(axis[:3, 2] @ rail[:3, 2]) < 1.0 - 1e-6:
            return
        z, moving = rail[:3, 2], self.bodies.bodies[slide.number]
        body = self.bodies.bodies[turning.number]
        low, high = self.bodies.skeleton.stroke(slide)
        if turns_nut:  # nuts that turn on a shaft that slides
            if self._coaxial(axis, rail):
                at = axis[:3, 3] + (1.3 if lead > 0.0 else -1.3) * u * z
                self._place(body, recipe("lathe", 6, 0, -1, 1, -1, 1, 1, 0, 1), (1.9 * u, 1.9 * u, 0.9 * u), at, z, axis[:3, 0])
                self.bodies.threads[slide.number] = abs(lead)
            return
        foot = axis[:3, 3] + z * (z @ (self._zero(slide) - axis[:3, 3]))
        start, length = foot + (low - 3.0 * u) * z, high - low + 6.0 * u
        turns = min(length / abs(lead), _MOST_TURNS) * math.copysign(1.0, lead * (z @ axis[:3, 2]))
        self._place(body, recipe("screw", turns, 0.3), (0.85 * u, 0.85 * u, length), start, z, axis[:3, 0])
        at = foot + z * (z @ (rail[:3, 3] - foot))
        self._place(moving, recipe("lathe", 6, 0, -1, 1, -1, 1, 1, 0, 1), (1.7 * u, 1.7 * u, u), at, z, axis[:3, 0])
        self._bracket(moving, rail[:3, 3], at)

    # --- shapes, in the world at home -------------------------------------------------------------------------------

    def _home_of(self, body: Body) -> Array:
        return self.world[next(iter(body.nodes))]

    def _place(
        self, body: Body, text: str, scale: tuple[float, ...], centre: Array, z: Array, x: Array, colour: object = None
    ) -> None:
        x = x - z * (z @ x)
        x = x / np.linalg.norm(x)
        placement = np.eye(4)
        placement[:3, :3], placement[:3, 3] = np.column_stack([x, np.cross(z, x), z]), centre
        self.bodies.add(body, ("mesh", scale, inverse(self._home_of(body)) @ placement, text), colour)

    def _put(self, body: Body, text: str, radius: float, high: float, centre: Array, way: Array, x: Array, phase: float, teeth: int) -> None:
        z = way / np.linalg.norm(way)
        x = x - z * (z @ x)
        x = x / np.linalg.norm(x)
        angle = math.tau * phase / teeth
        tooth = x * math.cos(angle) + np.cross(z, x) * math.sin(angle)
        self._place(body, text, (radius, radius, radius), centre, z, tooth)

    def _cylinder(self, body: Body, radius: float, start: Array, end: Array, colour: object = None) -> None:
        from raff2urdf.graphics.bodies import along

        place = inverse(self._home_of(body)) @ along(0.5 * (start + end), end - start)
        self.bodies.add(body, ("cylinder", (radius, float(np.linalg.norm(end - start))), place, ""), colour)

    def _bracket(self, body: Body, start: Array, end: Array) -> None:
        if np.linalg.norm(end - start) > self.unit:
            self._cylinder(body, 0.5 * self.unit, start, end)
