"""Inverse kinematics of some robots in closed form, written down from their RAFF files: in m, limits in degrees.

Each function counts solutions cell by cell, within joint limits or without; those that differ only in how a universal
joint lies count once.
"""

import numpy as np
from five_bar import two_bar_angles
from numpy import cos, pi, radians, sin


def within(angle, low, high):
    """Whether an angle, or one whole turns away, is between two others, degrees."""
    return (angle - radians(low)) % (2.0 * pi) <= radians(high - low)


def five_bar(x, y, limits=True):
    """Motors 300 apart, inner bars 250, outer bars 400."""
    count = np.zeros(np.shape(x), dtype=int)
    for left in (1, -1):
        for right in (1, -1):
            q1, q2, reaches = two_bar_angles(x + 0.15, y, 0.25, 0.4, left)
            q3, q4, too = two_bar_angles(x - 0.15, y, 0.25, 0.4, right)
            ok = reaches & too
            if limits:
                ok &= within(q1, 60, 200) & within(q2, -170, -5) & within(q3, -20, 120) & within(q4, 5, 170)
                ok &= within(q1 + q2 - q3 - q4, -175, -5)
            count += ok
    return count


def delta4(x, y, z, limits=True):
    """Base 1500, upper arms 2000, forearms 3500, platform 506.54: a product over the three arms."""
    count = np.ones(np.shape(x), dtype=int)
    for degrees in (0.0, 120.0, 240.0):
        c, s = cos(radians(degrees)), sin(radians(degrees))
        outward, aside = c * x + s * y + 0.50654 - 1.5, -s * x + c * y  # the wrist, seen from the shoulder
        flat = 3.5**2 - aside**2  # of the forearm, squared, in the upper arm's plane
        of_arm = np.zeros(np.shape(x), dtype=int)
        for elbow in (1, -1):
            shoulder, knee, ok = two_bar_angles(outward, z, 2.0, np.sqrt(np.maximum(flat, 1e-12)), elbow)
            ok = ok & (flat >= 0.0)
            if limits:
                swing = np.arcsin(np.clip(aside / 3.5, -1.0, 1.0))
                ok &= within(shoulder, -85, 80) & within(knee, 185, 355) & within(swing, -60, 60)
                ok &= within(pi - shoulder - knee, -120, 40)
            of_arm += ok
        count *= of_arm
    return count


def rx90(points, rotations, limits=True, order=True):
    """(n,) solutions of an arm of 450 and 450 whose wrist's axes meet where the tool is; or, where it only matters how
    the tool's z lies (`order` false), whether there is one: the wrist bends so far, about any direction."""
    count = np.zeros(len(points), dtype=int)
    x, y, z = points.T
    for front in (1, -1):
        q1 = np.arctan2(front * y, front * x)
        for elbow in (1, -1):
            q2, bent, ok = two_bar_angles(front * np.hypot(x, y), z, 0.45, 0.45, elbow)
            up = q2 + bent
            forearm = np.column_stack([cos(q1) * cos(up), sin(q1) * cos(up), sin(up)])
            q5 = np.degrees(np.arccos(np.clip((forearm * rotations[:, :, 2]).sum(axis=1), -1.0, 1.0)))
            if limits:
                ok = ok & within(q1, -160, 160) & within(q2, -47.5, 227.5) & within(bent - pi / 2, -232.5, 52.5)
                count += ok * ((q5 <= 105.0).astype(int) + (q5 <= 120.0))
            else:
                count += 2 * ok
    return count if order else (count > 0).astype(int)
