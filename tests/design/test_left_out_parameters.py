"""Parameters that were not estimated, and explain the readings better, or as well: towers of a delta."""

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
from calibration_data import POSE, everything, exact, noisy

from cinegen.design import Measurements, Parameters, calibrate
from cinegen.errors import CinegenWarning

DELTA = everything("delta4")


def readings(changed: dict[str, str], kinds: int, noise: float, angles: float = 1.0) -> Measurements:
    """Readings of a delta with other dimensions: positions of its platform, or poses; factors of their noise."""
    given = exact(DELTA, [f"platform.{c}" for c in POSE[:kinds]], DELTA.with_changed(changed), 25, 1)
    factors = np.array([noise if one.kind in "xyz" else angles for one in given.quantities])
    return noisy(replace(given, sigmas=factors * given.sigmas), 101)


def test_a_tower_beside_its_place_is_told_from_a_turned_one():
    """A turned tower turns the joints of its rods, too: the readings don't fit then."""
    given = readings({"link6.r": "8mm"}, 3, 1.0)
    with pytest.warns(CinegenWarning, match=r"link6\.r \(or .*\), which is not estimated, would explain") as met:
        turned = calibrate(Parameters("delta4", ["link6.gamma"]), given, folds=0)
    added = re.search(r"(link\S+) \(or .* add it to --vary", str(met[0].message))[1]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = calibrate(Parameters("delta4", ["link6.gamma", added]), given, folds=0, sigma={added: "10mm"})
    values = dict(zip(found.names, found.values, strict=True))
    assert values["link6.r"] == pytest.approx(0.008, abs=2e-4)
    assert values["link6.gamma"] == pytest.approx(np.radians(120), abs=1e-4)
    assert turned.values[0] < np.radians(119.9)  # -0.13 degrees: what a wrong model makes of the place


def test_several_towers_beside_their_places_are_named():
    given = readings({"link6.r": "8mm", "link12.r": "5mm"}, 3, 1.0)
    with pytest.warns(
        CinegenWarning, match=r"link6\.r .*, link12\.r .*, which are not estimated, .* add them to --vary"
    ):
        calibrate(Parameters("delta4", ["*.gamma"]), given, folds=0)


def test_an_angle_that_fits_is_told_from_a_place_that_fits_as_well_by_the_rotation_of_the_platform():
    """Positions of 5 mm noise fit a turned tower, and one beside its place."""
    turned = Parameters("delta4", ["link6.gamma"])
    says = r"link6\.gamma changes by 0\.\d+ deg, but link6\.r by \d.* instead fits as well .* measure what differs"
    with pytest.warns(CinegenWarning, match=says):
        calibrate(turned, readings({"link6.gamma": "120.3deg"}, 3, 100.0), folds=0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = calibrate(turned, readings({"link6.gamma": "120.3deg"}, 6, 100.0), folds=0)
    assert found.values[0] == pytest.approx(np.radians(120.3), abs=4.0 * found.sigmas[0])
