"""Maps of the accuracy: single configurations, and what they take."""

from pathlib import Path

import numpy as np
import pytest

import cinegen
from cinegen.cli import main
from cinegen.design import tolerance
from cinegen.workspace import GridAxis, MapError, MapSpecification, Region, make_map, open_map

ROBOTS = Path(__file__).parents[2] / "robots"
SIGMA = {"link*.d": "0.1mm", "tool.d": "0.1mm"}
GIVEN = {"raff": (ROBOTS / "five_bar.raff").read_text(), "sigma": SIGMA, "encoder": {"joint1": "0.01deg"}}
REGION = Region((GridAxis("x", -0.2, 0.2, 4), GridAxis("y", 0.3, 0.6, 3)))


def test_each_cell_has_the_accuracy_of_its_configuration(tmp_path):
    five_bar = cinegen.load("five_bar")
    spec = MapSpecification(five_bar, REGION, ("accuracy",), tolerances=GIVEN)
    found = make_map(spec, tmp_path / "map.zarr", workers=1)
    values, joints = found.accuracy.values.ravel(), found.configuration.values.reshape(-1, len(five_bar.joints))
    known = np.flatnonzero(np.isfinite(values))
    assert len(known) >= 6
    for i in known:
        q = five_bar.configuration(dict(zip(found.joint.values.tolist(), joints[i].tolist(), strict=True)))
        one = tolerance("five_bar", SIGMA, encoder={"joint1": "0.01deg"}, q=q)
        np.testing.assert_allclose(values[i], one.position, rtol=1e-5)  # maps are stored as float32
    found.close()
    assert open_map(tmp_path / "map.zarr").accuracy.attrs["units"] == "m"


@pytest.mark.parametrize(
    ("quantities", "tolerances", "message"),
    [
        (("accuracy",), {}, "accuracy takes tolerances: give them"),
        (("sigma_1",), GIVEN, "no quantity of this map takes them"),
        (("accuracy",), {"sigma": SIGMA}, "tolerances have the keys raff"),
        (("accuracy",), {**GIVEN, "raff": GIVEN["raff"].replace("actuated 1", "actuated 0", 1)}, "is not as its RAFF"),
    ],
)
def test_what_does_not_fit_is_refused(quantities, tolerances, message):
    with pytest.raises(MapError, match=message):
        MapSpecification(cinegen.load("five_bar"), REGION, quantities, tolerances=tolerances)


def test_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["map", "five_bar", "--over", "x=-0.1..0.1:2,y=0.4..0.5:2", "--workers", "1"]
    assert main([*words, "--sigma", "link*.d=0.1mm", "--play", "joint2=0.02mm", "-o", "a.zarr"]) == 0
    assert "accuracy" in capsys.readouterr().out
    assert main([*words, "--sigma", "link*.q=0.1mm", "-o", "b.zarr"]) == 1
    assert "matches no parameter" in capsys.readouterr().err
    assert main([*words, "--sigma", "link*.d=0.1mm", "--vary", "link2.d=0.2..0.3:2", "-o", "c"]) == 2
    assert "exclude each other" in capsys.readouterr().err
