"""Draws the pictures of docs/parallel.md again: `python docs/pictures/parallel.py [NAME ...]`. Takes a minute."""

import math

import numpy as np
from figures import ROBOTS, write

import cinegen
from cinegen.collision import load_scene
from cinegen.planning import change_mode
from cinegen.plotting import draw_modes
from cinegen.plotting.loci import draw_loci
from cinegen.plotting.sheet import BLUE, INK, VERMILION, finish, label, sheet
from cinegen.singularities.loci import singular_loci
from cinegen.singularities.slice import Axis, Slice
from raff2urdf.quantities import show_lengths_in


def modes():
    """Merlet's figure 5, and the mirror images below the base."""
    show_lengths_in("mm")
    return draw_modes(cinegen.assembly_modes(cinegen.load(ROBOTS / "tssm.raff")))


def five_bar():
    """All that its tool reaches with its elbows outside."""
    show_lengths_in("m")
    # An even count: the grid leaves out x = 0 and y = 0, where singularities of both types meet in one point.
    axes = Axis("x", -0.55, 0.55), Axis("y", -0.7, 0.7)
    return draw_loci(singular_loci(Slice(cinegen.load(ROBOTS / "five_bar.raff"), axes), 100), name="five_bar")


def tssm():
    """Fichter's singularity: a platform that lies level, turned by a quarter of a turn."""
    show_lengths_in("mm")
    axes = Axis("x", -0.01, 0.01), Axis("rz", -math.radians(120), math.radians(120))
    return draw_loci(
        singular_loci(Slice(cinegen.load(ROBOTS / "tssm.raff"), axes, {"rx": 0.0, "ry": 0.0}), 40), name="tssm"
    )


def cusp():
    """A change of assembly mode with the first leg locked: in joint space, and among the configurations."""
    task = load_scene(ROBOTS / "scenes" / "cusp.toml")
    change = change_mode(task, locked=["joint2"], seconds=600.0)
    mechanism, home = task.mechanism, task.mechanism.q_home
    base = [mechanism.placement(home, link).translation[:2] for link in ("link1", "link4", "link6")]
    platform = mechanism.placement(home, "platform")
    ends = [
        platform.actInv(mechanism.placement(home, pin).translation)[:2] for pin in ("platform", "frame20", "frame21")
    ]

    def lines(leg, angle):
        """Determinant of the legs' lines, and lengths of legs 2 and 3, m, over angles of leg 1 and of the platform."""
        x, y, rows, lengths = home[1] * np.cos(leg), home[1] * np.sin(leg), [], []
        for foot, end in zip(base, ends, strict=True):
            arm = end[0] * np.cos(angle) - end[1] * np.sin(angle), end[0] * np.sin(angle) + end[1] * np.cos(angle)
            along = x + arm[0] - foot[0], y + arm[1] - foot[1]
            rows.append([*along, arm[0] * along[1] - arm[1] * along[0]])
            lengths.append(np.hypot(*along))
        return np.linalg.det(np.moveaxis(np.array(rows), (0, 1), (-2, -1))), lengths[1:]

    figure, body = sheet(9.0, 4.0, "cusp_3rpr", str(change))
    joints, configurations = body.subplots(1, 2)
    grid = np.linspace(-np.pi, np.pi, 1201)
    leg, angle = np.meshgrid(grid, grid)
    curves = configurations.contour(leg, angle, lines(leg, angle)[0], levels=[0.0], colors=VERMILION, linewidths=1.2)
    for curve in curves.allsegs[0]:
        joints.plot(*(1e3 * length for length in lines(*curve.T)[1]), color=VERMILION, linewidth=1.2)
    joints.plot([], [], color=VERMILION, label="singular, type 2")
    path = change.plan.path
    joints.plot(1e3 * path[:, 4], 1e3 * path[:, 6], color=BLUE, label="path")
    poses = np.array([[q[0], q[0] + q[2] + np.pi / 2.0] for q in path])
    wrapped = np.remainder(poses + np.pi, 2.0 * np.pi) - np.pi
    wrapped[1:][np.abs(np.diff(wrapped, axis=0)).max(axis=1) > np.pi] = np.nan
    configurations.plot(*wrapped.T, color=BLUE)
    joints.plot(1e3 * path[0, 4], 1e3 * path[0, 6], "o", color=INK, label="start, and other assembly modes")
    for q in change.modes:
        at = np.remainder(np.array([q[0], q[0] + q[2] + np.pi / 2.0]) + np.pi, 2.0 * np.pi) - np.pi
        configurations.plot(*at, "o", color=INK)
    joints.set(xlim=(0, 320), ylim=(0, 320))
    label(joints, "joint5, mm", "joint7, mm")
    label(configurations, "direction of leg 1, rad", "rotation of the platform, rad")
    finish(figure)
    return figure


FIGURES = {"tssm_modes": modes, "five_bar_singular": five_bar, "tssm_singular": tssm, "cusp_3rpr_modes": cusp}
"""What draws each of them."""


if __name__ == "__main__":
    write(FIGURES)
