"""Lines made to lie in a variety, from its definition by points, planes and motions: no Pluecker coordinates."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cinegen.singularities.line_varieties import GrassmannClass
from cinegen.singularities.pluecker import LineFrame, PlueckerLine

Array = NDArray[np.float64]
Segment = tuple[Array, Array]  # two points of a line


@dataclass
class Built:
    """Segments of lines in a variety, and what defines it: points (also far ones, as directions) and segments."""

    grassmann_class: GrassmannClass
    segments: list[Segment]
    points: list[Array] = field(default_factory=list)
    directions: list[Array] = field(default_factory=list)  # points at infinity
    directors: list[Segment] = field(default_factory=list)
    normals: list[Array] = field(default_factory=list)  # of directors at infinity
    pitch: float | None = None


def _unit(rng):
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def _turn(rng, count):
    """Angles that are not too near each other modulo pi."""
    even = np.linspace(0.0, np.pi, count, endpoint=False)
    return even + rng.uniform(-0.6, 0.6, count) / count + rng.uniform(0.0, 7.0)


def _at(point, direction, rng):
    """Two points of a line, anywhere on it."""
    start = point + rng.uniform(-1.0, 1.0) * direction
    return start, start + rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 2.0) * direction


def _in_plane(angle):
    return np.array([np.cos(angle), np.sin(angle), 0.0])


X, _, Z = np.eye(3)


def one_line(rng, count=2):
    point, direction = rng.normal(size=3), _unit(rng)
    segments = [_at(point, direction, rng) for _ in range(count)]
    return Built(GrassmannClass.ONE_LINE, segments, directors=[(point, point + direction)])


def flat_pencil(rng, count=3):
    point = rng.normal(size=3) * [1, 1, 0]
    return Built(GrassmannClass.FLAT_PENCIL, [_at(point, _in_plane(a), rng) for a in _turn(rng, count)], points=[point])


def parallels_in_plane(rng, count=3):
    offsets = np.linspace(-1.0, 1.0, count) + rng.uniform(-0.3, 0.3, count)
    segments = [_at(np.array([0.0, y, 0.0]), X, rng) for y in offsets]
    return Built(GrassmannClass.FLAT_PENCIL, segments, directions=[X])


def hyperboloid(rng, count=4):
    a, b, c = rng.uniform(0.6, 1.5, 3)
    segments = []
    for t in 2.0 * _turn(rng, count):
        point = np.array([a * np.cos(t), b * np.sin(t), 0.0])
        segments.append(_at(point, np.array([-a * np.sin(t), b * np.cos(t), c]), rng))
    return Built(GrassmannClass.REGULUS, segments)


def two_pencils(rng, count=4):
    """The x axis is shared; its points 0 and P are the vertices."""
    far = np.array([rng.uniform(0.7, 1.5), 0.0, 0.0])
    tilt = rng.uniform(0.5, 2.5)
    segments = [_at(np.zeros(3), _in_plane(a), rng) for a in rng.uniform([0.5, 1.8], [1.2, 2.6])]
    for a in rng.uniform([0.5, 1.8], [1.2, 2.6]):
        segments.append(_at(far, np.array([np.cos(a), np.sin(a) * np.cos(tilt), np.sin(a) * np.sin(tilt)]), rng))
    return Built(GrassmannClass.TWO_PENCILS, segments, points=[np.zeros(3), far], directors=[(np.zeros(3), far)])


def two_pencils_one_parallel(rng, count=4):
    home, tilt = np.zeros(3), rng.uniform(0.5, 2.5)
    segments = [_at(home, _in_plane(a), rng) for a in rng.uniform([0.5, 1.8], [1.2, 2.6])]
    for y in rng.uniform([-1.2, 0.6], [-0.6, 1.2]):
        segments.append(_at(y * np.array([0.0, np.cos(tilt), np.sin(tilt)]), X, rng))
    return Built(GrassmannClass.TWO_PENCILS, segments, points=[home], directions=[X], directors=[(home, X)])


def bundle(rng, count=4):
    point = rng.normal(size=3)
    return Built(GrassmannClass.BUNDLE, [_at(point, _unit(rng), rng) for _ in range(count)], points=[point])


def parallels(rng, count=4):
    direction = _unit(rng)
    segments = [_at(rng.normal(size=3), direction, rng) for _ in range(count)]
    return Built(GrassmannClass.BUNDLE, segments, directions=[direction])


def plane(rng, count=4):
    flat = [1.0, 1.0, 0.0]
    return Built(GrassmannClass.PLANE, [_at(rng.normal(size=3) * flat, _in_plane(a), rng) for a in _turn(rng, count)])


def elliptic(rng, count=5):
    """Lines that twist about the z axis, all the same way."""
    c, places = rng.uniform(0.5, 1.5), rng.normal(size=(count, 2))
    segments = [_at(np.array([x, y, 0.0]), np.array([-y, x, c]), rng) for x, y in places]
    return Built(GrassmannClass.ELLIPTIC_CONGRUENCE, segments)


def hyperbolic(rng, count=5):
    first, second = np.array([1.0, 0.2, 0.0]), np.array([-0.3, 1.0, 0.4])
    segments = [(s * first, Z + t * second) for s, t in rng.uniform(-2.0, 2.0, (count, 2))]
    return Built(GrassmannClass.HYPERBOLIC_CONGRUENCE, segments, directors=[(np.zeros(3), first), (Z, Z + second)])


def hyperbolic_one_far(rng, count=5):
    a = (np.zeros(3), np.array([0.3, -0.2, 1.0]))
    stations = zip(rng.uniform(-2, 2, count), _turn(rng, count), strict=True)
    segments = [_at(s * a[1], _in_plane(t), rng) for s, t in stations]
    return Built(GrassmannClass.HYPERBOLIC_CONGRUENCE, segments, directors=[a], normals=[Z])


def _fan(rng, count):
    """Points of the z axis, and directions across it which turn as tan(angle) = z / k."""
    k, heights = rng.uniform(0.5, 1.5), np.linspace(-1.5, 1.5, count) + rng.uniform(-0.2, 0.2, count)
    return [(z * Z, np.array([k, z, 0.0]) / np.hypot(k, z)) for z in heights]


def parabolic(rng, count=5):
    """Through each point of the z axis a pencil in a plane through it."""
    segments = [_at(point, across + rng.uniform(-1.5, 1.5) * Z, rng) for point, across in _fan(rng, count)]
    return Built(GrassmannClass.PARABOLIC_CONGRUENCE, segments, directors=[(np.zeros(3), Z)])


def parabolic_far(rng, count=5):
    """In each plane with normal z all lines are parallel."""
    fan = _fan(rng, count)
    segments = [_at(point + rng.uniform(-1.5, 1.5) * np.cross(Z, along), along, rng) for point, along in fan]
    return Built(GrassmannClass.PARABOLIC_CONGRUENCE, segments, normals=[Z])


def _degenerate(rng, through):
    """`through` lines meet the origin, the others lie in z = 0."""
    segments = [_at(np.zeros(3), _unit(rng), rng) for _ in range(through)]
    for a in _turn(rng, 5 - through):
        segments.append(_at(rng.normal(size=3) * [1, 1, 0], _in_plane(a), rng))
    return Built(GrassmannClass.DEGENERATE_CONGRUENCE, segments, points=[np.zeros(3)])


def degenerate_three_through(rng):
    return _degenerate(rng, 3)


def degenerate_three_inside(rng):
    return _degenerate(rng, 2)


def degenerate_parallel(rng):
    segments = [_at(rng.normal(size=3), X, rng) for _ in range(3)]
    segments += [_at(rng.normal(size=3) * [1, 1, 0], _in_plane(a), rng) for a in rng.uniform([0.4, 1.7], [1.4, 2.7])]
    return Built(GrassmannClass.DEGENERATE_CONGRUENCE, segments, directions=[X])


def general_complex(rng, count=6):
    """Each line stands across the velocity that one of its points has in a screw motion about the z axis."""
    pitch = rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 3.0)
    segments = []
    for _ in range(count):
        point = rng.normal(size=3)
        across = np.cross(np.cross(Z, point) + pitch * Z, rng.normal(size=3))
        segments.append(_at(point, across / np.linalg.norm(across), rng))
    return Built(GrassmannClass.GENERAL_COMPLEX, segments, directors=[(np.zeros(3), Z)], pitch=pitch)


def special_complex(rng, count=6):
    segments = [_at(z * Z, _unit(rng), rng) for z in rng.uniform(-2.0, 2.0, count)]
    return Built(GrassmannClass.SPECIAL_COMPLEX, segments, directors=[(np.zeros(3), Z)], pitch=0.0)


def special_complex_far(rng, count=6):
    segments = [_at(rng.normal(size=3), _in_plane(a), rng) for a in _turn(rng, count)]
    return Built(GrassmannClass.SPECIAL_COMPLEX, segments, normals=[Z], pitch=np.inf)


ALL = [
    one_line, flat_pencil, parallels_in_plane, hyperboloid, two_pencils, two_pencils_one_parallel, bundle,
    parallels, plane, elliptic, hyperbolic, hyperbolic_one_far, parabolic, parabolic_far, degenerate_three_through,
    degenerate_three_inside, degenerate_parallel, general_complex, special_complex, special_complex_far,
]  # fmt: skip


def rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


@dataclass
class Placed:
    """A variety's lines among others, turned, scaled, moved and shuffled."""

    built: Built
    lines: list[PlueckerLine]
    where: tuple[int, ...]  # of the variety's lines
    length: float
    turn: Array
    shift: Array

    def point(self, xyz):
        return self.turn @ (self.length * xyz) + self.shift

    def line(self, segment):
        return PlueckerLine.through(*(self.point(end) for end in segment))


def _gap(lines, length, rank):
    vectors = np.array([[*line.direction, *line.moment / length] for line in lines])
    return np.linalg.svd(vectors, compute_uv=False)[rank - 1]


def placed(maker, rng, noise=0.0, others=None):
    """Lines of a variety that span it well, with a smallest singular value of at least 0.05, among other lines."""
    length = 10.0 ** rng.uniform(-3.0, 3.0)
    turn, shift = rotation(rng), length * rng.normal(size=3)
    while True:
        built = maker(rng)
        count = len(built.segments)
        extra = rng.integers(0, 7 - count) if others is None else others
        segments = built.segments + [tuple(rng.normal(size=(2, 3))) for _ in range(extra)]
        plain = [PlueckerLine.through(*ends) for ends in segments]
        if _gap(plain, 1.0, len(plain) - 1) < 0.05 or any(np.linalg.norm(e) > 20.0 for s in segments for e in s):
            continue
        subsets = [[j for j in range(count) if j != i] for i in range(count)]
        if min(_gap([plain[j] for j in some], 1.0, count - 1) for some in subsets) >= 0.05:
            break
    result = Placed(built, [], (), length, turn, shift)
    order = rng.permutation(len(segments))
    moved = [[result.point(end + noise * rng.normal(size=3)) for end in ends] for ends in segments]
    result.lines = [PlueckerLine.through(*moved[i]) for i in order]
    result.where = tuple(int(i) for i in np.flatnonzero(order < count))
    return result


def nearness(lines, length):
    """The smallest singular value of all lines, moments about the middle of the lines."""
    return float(np.linalg.svd(LineFrame.of(lines, length).coordinates(lines), compute_uv=False)[-1])
