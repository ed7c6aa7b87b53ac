"""Precision points of a four-bar, judged by circles that intersect."""

import warnings

import numpy as np
import pytest
from variants import slow

import cinegen
from cinegen.design import DesignError, Parameters, synthesize

RANGES = {
    "link1.gamma": "-180..180", "link1.d": "0..3m", "link3.gamma": "-180..180", "link3.d": "0..3m",
    "link2.d": "0.1..3m", "frame4.d": "0.1..4m", "frame5.d": "0.1..4m",
    "frame20.gamma": "-180..180", "frame20.d": "0..3m",
}  # fmt: skip
NINE = [[0.25, 0.0], [0.52, 0.10], [0.80, 0.70], [1.20, 1.00], [1.40, 1.30], [1.10, 1.48], [0.70, 1.40], [0.20, 1.00],
        [0.02, 0.40]]  # fmt: skip
"""Problem 3 of Wampler, Morgan and Sommese, "Complete solution of the nine-point path synthesis problem", 1992."""


def joints_of_crank(p: dict[str, float], target: np.ndarray) -> np.ndarray:
    """Return what the rocker lacks (2,) where the coupler point is at a target, for both places of the crank's end."""
    pivot, other = (p[f"{k}.d"] * np.exp(1j * p[f"{k}.gamma"]) for k in ("link1", "link3"))
    wanted, crank, arm = complex(*target), p["link2.d"], p["frame20.d"]
    apart = wanted - pivot
    along = (crank**2 - arm**2 + abs(apart) ** 2) / (2.0 * abs(apart))
    across = np.sqrt(crank**2 - along**2 + 0j).real
    ends = pivot + apart / abs(apart) * (along + np.array([1j, -1j]) * across)
    coupler = np.exp(1j * (np.angle(wanted - ends) - p["frame20.gamma"]))
    return np.abs(ends + p["frame4.d"] * coupler - other) - p["frame5.d"]


def values_of(found) -> dict[str, float]:
    return dict(zip(found.parameters.names, found.p, strict=True))


@pytest.mark.parametrize(("points", "starts"), [(NINE[:8:2], 4), *slow((NINE, 24))], ids=["four", "nine"])
def test_path(points, starts, tmp_path):
    found = synthesize("four_bar", {"parameters": RANGES, "path": {"points": points}, "starts": starts})
    assert found.error.max() < 1e-9
    assert found.one_circuit
    assert found.in_order
    values = values_of(found)
    lack = [np.abs(joints_of_crank(values, np.array(point))).min() for point in points]
    assert max(lack) < 1e-9
    path = tmp_path / "best.raff"
    path.write_text(found.raff, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cinegen.CinegenWarning)  # home is outside of the limits of joint3
        assert cinegen.load(path).mobility == 1


def test_guidance():
    poses = [[0.2, 0.4, 10.0], [0.3, 0.45, 30.0], [0.35, 0.42, 55.0]]
    found = synthesize("four_bar", {"parameters": RANGES, "guidance": {"poses": poses}, "starts": 4})
    assert found.error.max() < 1e-9
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cinegen.CinegenWarning)  # home is outside of the limits of joint3
        robot = found.parameters.mechanism_with(found.p)
    for q, (x, y, angle) in zip(found.q, poses, strict=True):
        place = robot.placement(robot.close(q), "tool")
        np.testing.assert_allclose(place.translation[:2], [x, y], atol=1e-6)
        turned = np.degrees(np.arctan2(place.rotation[1, 0], place.rotation[0, 0]))
        assert (turned - angle + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-4)


def test_function():
    ranges = {name: RANGES[name] for name in ("link2.d", "frame4.d", "frame5.d")} | {"link2.d": "50mm..0.8m"}
    pairs = [[40.0, 95.0], [65.0, 103.0], [90.0, 115.0]]
    task = {"parameters": ranges, "function": {"input": "joint1", "output": "joint3", "pairs": pairs}, "starts": 2}
    found = synthesize("four_bar", task)
    assert found.error.max() < 1e-9
    p, fixed = values_of(found), Parameters("four_bar").values[Parameters("four_bar").index("link3.d")]
    for crank, rocker in np.radians(pairs):  # Freudenstein: the coupler's length at each pair
        ends = p["link2.d"] * np.exp(1j * crank), fixed + p["frame5.d"] * np.exp(1j * rocker)
        assert abs(ends[0] - ends[1]) == pytest.approx(p["frame4.d"], abs=1e-9)


@pytest.mark.parametrize(
    ("robot", "values", "message"),
    [
        ("five_bar", {"parameters": {"link2.d": "0.1..1m"}, "path": {"points": NINE}}, "has mobility 2"),
        ("four_bar", {"parameters": RANGES, "path": {"points": NINE[:1]}}, "must be two or more"),
        ("four_bar", {"parameters": RANGES, "path": {"points": NINE, "pionts": 1}}, "did you mean 'points'"),
        ("four_bar", {"parameters": RANGES, "path": {"points": [[1, 2, 3]]}}, "rows of 2 numbers"),
        ("four_bar", {"parameters": RANGES, "path": {"points": NINE}, "guidance": {"poses": []}}, "cannot be combined"),
        ("four_bar", {"parameters": {"link2.alpha": "-1..1"}, "path": {"points": NINE}}, "opens the loops"),
    ],
)
def test_bad_precision_points(robot, values, message):
    with pytest.raises(DesignError, match=message):
        synthesize(robot, values)
