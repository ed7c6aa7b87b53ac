"""`Sketch`: a line drawing in space as SVG: bars, joints, frames and dimensions in parallel projection, farthest first.

Positions are in mm; widths of lines, arrowheads and texts in pixels, so that they look the same in every drawing.
"""

import math
from html import escape

import numpy as np
from scipy.spatial import ConvexHull

from cinegen.plotting.sheet import BLUE, FAINT, GREEN, INK, VERMILION

AXES = VERMILION, GREEN, BLUE
"""Colours of x, y and z."""
WIDE = 720  # pixels
GROUND, GRID, SHADOW = "#f1f3f5", "#dde1e6", "#2b3036"
_MARGIN, _TEXT, _HEAD = 16.0, 15.0, 9.0  # pixels: around the drawing, height of a text, length of an arrowhead
_LETTER = 0.56  # width of a letter, heights of a text
_STYLE = (
    "<style>text{font-family:system-ui,'Segoe UI',Roboto,'DejaVu Sans',sans-serif;font-size:15px;"
    "paint-order:stroke;stroke:#fff;stroke-width:4px;stroke-linejoin:round}.i{font-style:italic}.b{font-weight:600}</style>"
    '<filter id="blur" x="-20%" y="-20%" width="140%" height="140%"><feGaussianBlur stdDeviation="4"/></filter>'
)


def unit(vector):
    """Return a vector of length 1."""
    return np.asarray(vector, dtype=float) / np.linalg.norm(vector)


def rotated(vector, axis, angle):
    """Return a vector (3,) rotated about a unit vector by an angle (rad)."""
    axis, vector = np.asarray(axis, dtype=float), np.asarray(vector, dtype=float)
    c, s = math.cos(angle), math.sin(angle)
    return c * vector + s * np.cross(axis, vector) + (1.0 - c) * (axis @ vector) * axis


def shade(colour, factor):
    """Return a colour, darker for a factor below 1 and lighter above."""
    rgb = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)], dtype=float)
    rgb = rgb * factor if factor <= 1.0 else 255.0 - (255.0 - rgb) * (2.0 - factor)
    return "#" + "".join(f"{round(value):02x}" for value in rgb)


class Sketch:
    """A drawing.

    Args:
        azimuth: direction of the eye about z, degrees; -90: x is to the right.
        elevation: of the eye, degrees; 90: y is up.
    """

    def __init__(self, azimuth=-90.0, elevation=90.0):
        a, e = math.radians(azimuth), math.radians(elevation)
        self.eye = np.array([math.cos(a) * math.cos(e), math.sin(a) * math.cos(e), math.sin(e)])
        self.right = np.array([-math.sin(a), math.cos(a), 0.0])
        self.up = np.cross(self.eye, self.right)
        self._items = []  # depth, points (n, 3), what makes SVG of their pixels (n, 2)
        self._texts = []  # point (3,), offset in pixels, text, class, colour

    # --- lines -----------------------------------------------------------------------------------------------------

    def line(self, points, colour=INK, width=1.4, dash="", lift=0.0, opacity=1.0, arrows=""):
        """Draw a line through points; `arrows` has < for a head at its beginning and > for one at its end."""
        dash = f' stroke-dasharray="{dash}"' if dash else ""

        def emit(pixels):
            shown = pixels.copy()
            heads = ""
            for sign, end, before in (("<", 0, 1), (">", -1, -2)):
                if sign in arrows:
                    heads += _head(pixels[end], _before(pixels, end, before), colour)
                    shown[end] += (0.6 * _HEAD) * _unit2(_before(pixels, end, before) - pixels[end])
            see = f' opacity="{opacity:g}"' if opacity < 1.0 else ""
            return (
                f'<path d="{_path(shown)}" fill="none" stroke="{colour}" stroke-width="{width:g}"{dash}{see} '
                f'stroke-linecap="round" stroke-linejoin="round"/>{heads}'
            )

        self._add(points, emit, lift)

    def bar(self, start, end, colour, width=11.0, lift=0.0, ghost=False):
        """Draw a round bar; a ghost is an outline."""
        if ghost:
            self.line([start, end], FAINT, 1.3, "5 4", lift)
            return

        def emit(pixels):
            side = _unit2(pixels[1] - pixels[0])[::-1] * (-1.0, 1.0)
            side = side if side[1] < 0.0 else -side  # light comes from above
            light = pixels + 0.22 * width * side
            return "".join(
                f'<path d="{_path(line)}" stroke="{stroke}" stroke-width="{wide:g}" stroke-linecap="round"/>'
                for line, stroke, wide in (
                    (pixels, shade(colour, 0.62), width + 2.0),
                    (pixels, colour, width),
                    (light, shade(colour, 1.5), 0.22 * width),
                )
            )

        self._add([start, end], emit, lift)

    def shadow(self, start, end, ground, width=10.0):
        """Draw the shadow of a bar on the ground below it, at the height `ground`."""
        points = np.array([start, end], dtype=float)
        points[:, 2] = ground
        self._add(
            points,
            lambda pixels: (
                f'<path d="{_path(pixels)}" stroke="{SHADOW}" stroke-width="{width:g}" opacity="0.16" '
                'stroke-linecap="round" filter="url(#blur)"/>'
            ),
            -1e6,
        )

    def ground(self, low, high, height, step):
        """Draw a ground between corners (2,), at a height, with lines every `step`."""
        (x0, y0), (x1, y1) = (np.floor(np.array(low) / step) * step, np.ceil(np.array(high) / step) * step)
        corners = [(x0, y0, height), (x1, y0, height), (x1, y1, height), (x0, y1, height)]
        self.polygon(corners, GROUND, GRID, lift=-3e6)
        for x in np.arange(x0 + step, x1, step):
            self.line([(x, y0, height), (x, y1, height)], GRID, 1.0, lift=-2e6)
        for y in np.arange(y0 + step, y1, step):
            self.line([(x0, y, height), (x1, y, height)], GRID, 1.0, lift=-2e6)

    def polygon(self, points, fill, stroke="none", lift=0.0, width=1.0, opacity=1.0):
        """Draw a polygon."""
        see = f' opacity="{opacity:g}"' if opacity < 1.0 else ""
        self._add(
            points,
            lambda pixels: (
                f'<path d="{_path(pixels)}Z" fill="{fill}" stroke="{stroke}" stroke-width="{width:g}" '
                f'stroke-linejoin="round"{see}/>'
            ),
            lift,
        )

    # --- joints ----------------------------------------------------------------------------------------------------

    def cylinder(self, centre, axis, radius, length, colour=INK, lift=0.0):
        """Draw a cylinder about an axis."""
        centre, axis = np.asarray(centre, dtype=float), unit(axis)
        side = unit(np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0]))
        ring = np.array([rotated(side, axis, t) for t in np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False)])
        ends = [centre + radius * ring + sign * 0.5 * length * axis for sign in (-1.0, 1.0)]
        near = ends[1] if axis @ self.eye >= 0.0 else ends[0]
        both = np.vstack(ends)
        flat = np.column_stack([both @ self.right, both @ self.up])
        self.polygon(both[ConvexHull(flat).vertices], shade(colour, 0.8), shade(colour, 0.55), lift)
        self.polygon(near, shade(colour, 1.25), shade(colour, 0.55), lift + 0.01 + 0.5 * length)

    def box(self, centre, axes, sides, colour=INK, lift=0.0):
        """Draw a box: axes (3, 3) are its directions as columns, sides (3,) its lengths."""
        axes, half = np.asarray(axes, dtype=float), 0.5 * np.asarray(sides, dtype=float)
        for k in range(3):
            normal = axes[:, k] * (1.0 if axes[:, k] @ self.eye >= 0.0 else -1.0)
            if normal @ self.eye < 1e-9:
                continue
            a, b = axes[:, (k + 1) % 3] * half[(k + 1) % 3], axes[:, (k + 2) % 3] * half[(k + 2) % 3]
            middle = np.asarray(centre, dtype=float) + normal * half[k]
            bright = 0.75 + 0.5 * max(0.0, float(normal @ unit([-0.3, -0.2, 0.9])))
            self.polygon(
                [middle + a + b, middle - a + b, middle - a - b, middle + a - b], shade(colour, bright),
                shade(colour, 0.55), lift,
            )  # fmt: skip

    def ball(self, centre, size, colour=INK, lift=0.0):
        """Draw a ball of a radius in pixels."""

        def emit(pixels):
            x, y = pixels[0]
            return (
                f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{size:g}" fill="{colour}" stroke="{shade(colour, 0.55)}"/>'
                f'<circle cx="{x - 0.3 * size:.1f}" cy="{y - 0.3 * size:.1f}" r="{0.28 * size:.1f}" '
                f'fill="{shade(colour, 1.6)}"/>'
            )

        self._add([centre], emit, lift)

    def ring(self, centre, size, colour, width=2.5, lift=0.0, dash=""):
        """Draw a ring of a radius in pixels."""
        dash = f' stroke-dasharray="{dash}"' if dash else ""
        self._add(
            [centre],
            lambda pixels: (
                f'<circle cx="{pixels[0, 0]:.1f}" cy="{pixels[0, 1]:.1f}" r="{size:g}" fill="none" stroke="{colour}" '
                f'stroke-width="{width:g}"{dash}/>'
            ),
            lift,
        )

    def foot(self, point, lift=0.0):
        """Draw the symbol of a joint that is fixed to the base, in a drawing of a plane."""

        def emit(pixels):
            x, y = pixels[0]
            hatch = "".join(f"M{x + dx:.1f} {y + 24:.1f}l-7 8" for dx in (-14, -5, 4, 13, 22))
            return (
                f'<path d="M{x:.1f} {y:.1f}l-13 24h26z" fill="#c9ced4" stroke="{INK}" stroke-linejoin="round"/>'
                f'<path d="M{x - 20:.1f} {y + 24:.1f}h40{hatch}" stroke="{INK}" fill="none" stroke-width="1.3"/>'
            )

        self._add([point], emit, lift)

    # --- frames and dimensions -------------------------------------------------------------------------------------

    def frame(self, origin, axes, size, name="", width=2.2, lift=0.0, opacity=1.0):
        """Draw the axes of a frame, axes (3, 3) as columns, with its name behind x, y and z."""
        origin = np.asarray(origin, dtype=float)
        for k, letter in enumerate("xyz"):
            direction = np.asarray(axes, dtype=float)[:, k]
            if np.hypot(direction @ self.right, direction @ self.up) < 0.05:
                continue  # it points at the eye
            end = origin + size * direction
            self.line([origin, end], AXES[k], width, lift=lift, arrows=">", opacity=opacity)
            if opacity == 1.0:
                self.text(end, f"{letter}{name}", direction, AXES[k], "i")

    def dimension(self, start, end, text, offset=(0.0, 0.0, 0.0), side=None):
        """Draw a length between two points, moved aside by an offset (3,) mm; the text is on a `side` of it."""
        start, end, offset = (np.asarray(vector, dtype=float) for vector in (start, end, offset))
        if np.linalg.norm(offset) > 0.0:
            for point in (start, end):
                self.line([point, point + 1.12 * offset], FAINT, 1.0, lift=1e4)
        self.line([start + offset, end + offset], INK, 1.4, lift=1e4, arrows="<>")
        side = offset if side is None else np.asarray(side, dtype=float)
        self.text(0.5 * (start + end) + offset, text, side, INK, "b", gap=7.0)

    def angle(self, centre, axis, begin, angle, radius, text):
        """Draw an angle (rad) about an axis, from a direction on, with both its sides."""
        centre, axis, begin = np.asarray(centre, dtype=float), unit(axis), unit(begin)
        steps = np.linspace(0.0, angle, max(2, round(abs(math.degrees(angle)) / 4.0) + 1))
        arc = np.array([centre + radius * rotated(begin, axis, step) for step in steps])
        for direction in (begin, rotated(begin, axis, angle)):
            self.line([centre, centre + 1.25 * radius * direction], FAINT, 1.2, "2 4", lift=9e3)
        fan = np.vstack([centre[None], arc])
        self.polygon(fan, FAINT, lift=-10.0, opacity=0.16)
        self.line(arc, INK, 1.4, lift=1e4, arrows=">")
        middle = rotated(begin, axis, 0.5 * angle)
        self.text(centre + radius * middle, text, middle, INK, "b", gap=7.0)

    def text(self, point, text, towards=(0.0, 0.0, 0.0), colour=INK, style="", gap=4.0):
        """Write a text beside a point, in a direction (3,)."""
        self._texts.append((np.asarray(point, dtype=float), np.asarray(towards, dtype=float), text, colour, style, gap))

    # --- SVG -------------------------------------------------------------------------------------------------------

    def svg(self, title, source="", tallest=520.0):
        """Return the drawing as SVG; `source` is a comment that names what it was drawn from."""
        points = np.vstack([points for _, points, _ in self._items] + [text[0][None] for text in self._texts])
        flat = np.column_stack([points @ self.right, -(points @ self.up)])
        low, size = flat.min(axis=0), np.maximum(np.ptp(flat, axis=0), 1e-9)
        left = right = above = below = _MARGIN
        scale = min((WIDE - left - right) / size[0], (tallest - above - below) / size[1])
        for _ in range(3):  # what texts need beyond the points depends on the scale, and the scale on it
            boxes = np.array([self._box(text, scale, low) for text in self._texts]).reshape(-1, 4)
            left = max(_MARGIN, _MARGIN - boxes[:, 0].min(initial=0.0))
            above = max(_MARGIN, _MARGIN - boxes[:, 1].min(initial=0.0))
            right = max(_MARGIN, _MARGIN + (boxes[:, 2] - scale * size[0]).max(initial=0.0))
            below = max(_MARGIN, _MARGIN + (boxes[:, 3] - scale * size[1]).max(initial=0.0))
            scale = min((WIDE - left - right) / size[0], (tallest - above - below) / size[1])
        left += 0.5 * (WIDE - left - right - scale * size[0])
        tall = round(above + below + scale * size[1])
        self.scale = scale

        def pixels(points):
            seen = np.column_stack([points @ self.right, -(points @ self.up)])
            return (seen - low) * scale + (left, above)

        body = [emit(pixels(points)) for _, points, emit in sorted(self._items, key=lambda item: item[0])]
        for text in self._texts:
            x0, y0, _, y1 = self._box(text, scale, low)
            kind = f' class="{text[4]}"' if text[4] else ""
            x, y = x0 + left, 0.5 * (y0 + y1) + above + 0.36 * _TEXT
            body.append(
                f'<text x="{x:.1f}" y="{y:.1f}" fill="{text[3]}" style="fill:{text[3]}"{kind}>{escape(text[2])}</text>'
            )
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE} {tall}" width="{WIDE}" height="{tall}" '
            f'role="img"><title>{escape(title)}</title>\n<!-- {source} -->\n{_STYLE}\n'
            f'<rect width="{WIDE}" height="{tall}" rx="6" fill="#fff"/>\n' + "\n".join(body) + "\n</svg>\n"
        )

    def _add(self, points, emit, lift):
        points = np.asarray(points, dtype=float).reshape(-1, 3)
        self._items.append((float((points @ self.eye).mean()) + lift, points, emit))

    def _box(self, text, scale, low):
        """Return left, top, right and bottom of a text, pixels from the corner of all points."""
        point, towards, words, _, _, gap = text
        at = (np.array([point @ self.right, -(point @ self.up)]) - low) * scale
        wide, tall = _LETTER * _TEXT * len(words), _TEXT
        way = np.array([towards @ self.right, -(towards @ self.up)])
        norm = np.linalg.norm(way)
        if norm < 1e-9:
            return (at[0] - 0.5 * wide, at[1] - 0.5 * tall, at[0] + 0.5 * wide, at[1] + 0.5 * tall)
        way = way / norm
        # The middle of the text lies so far along the direction that its box just keeps clear of the point.
        reach = min(
            (0.5 * wide + gap) / max(abs(way[0]), 1e-9), (0.5 * tall + gap) / max(abs(way[1]), 1e-9)
        )  # fmt: skip
        x, y = at + reach * way
        return (x - 0.5 * wide, y - 0.5 * tall, x + 0.5 * wide, y + 0.5 * tall)


def _path(pixels):
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in pixels)


def _unit2(vector):
    return vector / max(float(np.linalg.norm(vector)), 1e-9)


def _before(pixels, end, before):
    """Return a point of a line at an arrowhead's length from one of its ends, or its neighbour."""
    order = pixels if end == 0 else pixels[::-1]
    for point in order[1:]:
        if np.linalg.norm(point - order[0]) >= _HEAD:
            return point
    return pixels[before]


def _head(tip, before, colour):
    along = _unit2(before - tip)
    across = along[::-1] * (-1.0, 1.0)
    corners = np.array([tip, tip + _HEAD * along + 0.38 * _HEAD * across, tip + _HEAD * along - 0.38 * _HEAD * across])
    return f'<path d="{_path(corners)}Z" fill="{colour}"/>'
