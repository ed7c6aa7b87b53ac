"""`write_labels`: names beside points of a picture, where they cover as little as possible."""

import itertools
import math

import numpy as np
from matplotlib import font_manager
from PIL import ImageDraw, ImageFont

from cinegen.plotting.sheet import BLUE, INK

_SIZE, _PAD, _DOT, _SIDE = 22, 6, 6, 12  # pixels: of letters, around them, of a point, least distance from an edge
_APART = 5  # pixels, between two names
_EMPTY = 250  # brightness of the background
_REACHES, _DIRECTIONS = (45, 70, 100, 140, 190), 16  # pixels, count: where a name may stand


def write_labels(image, points):
    """Write names at points (2,), pixels, with a line from each to its name; return the image."""
    draw = ImageDraw.Draw(image)
    font = ImageFont.truetype(font_manager.findfont("DejaVu Sans"), _SIZE)
    covered = (np.asarray(image).min(axis=2) < _EMPTY).astype(float)
    bright = np.asarray(image).min(axis=2) > 215  # ground: a name may stand there
    covered[bright] *= 0.15
    placed = []
    for name, point in points.items():
        wide = draw.textlength(name, font=font) + 2 * _PAD
        box = min(
            (_box(point, reach, turn, wide) for reach, turn in itertools.product(_REACHES, range(_DIRECTIONS))),
            key=lambda box: _cost(box, point, covered, placed, image.size),
        )
        placed.append(box)
        _write(draw, font, name, point, box)
    return image


def _box(point, reach, turn, wide):
    """Return left, top, right and bottom of a name at a distance from a point."""
    angle = 2.0 * math.pi * turn / _DIRECTIONS
    x = point[0] + (reach + 0.35 * wide) * math.cos(angle)
    y = point[1] + reach * math.sin(angle)
    half = 0.5 * _SIZE + _PAD
    return x - 0.5 * wide, y - half, x + 0.5 * wide, y + half


def _cost(box, point, covered, placed, size):
    """Return what is covered by a name: of the robot, other names, and the distance."""
    left, top, right, bottom = box
    if left < _SIDE or top < _SIDE or right > size[0] - _SIDE or bottom > size[1] - _SIDE:
        return math.inf
    part = covered[int(top) : int(bottom), int(left) : int(right)].mean()
    ends = np.array(point), np.array([min(max(point[0], left), right), min(max(point[1], top), bottom)])
    line = [(1.0 - part) * ends[0] + part * ends[1] for part in np.linspace(0.0, 1.0, 20)]
    clash = sum(
        (left < r + _APART and x - _APART < right and top < b + _APART and y - _APART < bottom)
        or any(x <= u <= r and y <= v <= b for u, v in line)
        for x, y, r, b in placed
    )
    far = math.hypot(0.5 * (left + right) - point[0], 0.5 * (top + bottom) - point[1])
    return 3.0 * part + 10.0 * clash + far / 400.0


def _write(draw, font, name, point, box):
    left, top, right, bottom = box
    x, y = point
    end = min(max(x, left), right), min(max(y, top), bottom)
    draw.line([(x, y), end], fill="white", width=5)
    draw.line([(x, y), end], fill=INK, width=2)
    draw.ellipse((x - _DOT, y - _DOT, x + _DOT, y + _DOT), fill=BLUE, outline="white", width=2)
    draw.rounded_rectangle(box, 8, fill="white", outline=INK, width=2)
    draw.text((0.5 * (left + right), 0.5 * (top + bottom)), name, fill=INK, font=font, anchor="mm")
