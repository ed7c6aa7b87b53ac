"""CSV files of measurements: what they say, and what is wrong with them."""

import numpy as np
import pytest

import cinegen
from cinegen.design import DesignError, Measurements

ROBOT = cinegen.load("five_bar")
HEADER = "pose, joint1 [deg], joint3 [deg], tool.x [mm], tool(0 0 50mm).distance(1000mm 0 0)\n"


def read(text: str) -> Measurements:
    return Measurements.loads(text, ROBOT, "m.csv")


def test_units_of_headers_and_cells():
    found = read(
        HEADER + "# tracker\nsigma,,,0.05,0.02mm\na,90,1.5rad,120,0.9\nb,80,70deg,0.2m,\nsigma,,,0.1,\nc,1,2,3,\n"
    )
    assert found.labels == ("a", "b", "c")
    np.testing.assert_allclose(found.values[:2, :3], [[np.pi / 2, 1.5, 0.12], [np.radians(80), np.radians(70), 0.2]])
    assert found.values[0, 3] == 0.9
    assert np.isnan(found.values[1:, 3]).all()
    np.testing.assert_allclose(found.sigmas[:, 2], [5e-5, 5e-5, 1e-4])
    assert not found.sigmas[:, :2].any()
    distance = found.quantities[3]
    assert (distance.kind, distance.of, distance.point) == ("distance", "tool", (0.0, 0.0, 0.05))
    assert distance.reference == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_written_files_are_read_again(mark):
    columns = ["joint1", "joint3", "tool.x", "tool.rz", "tool.along(0 3 4)"]
    values = [[1.0, 2.0, 0.1, 0.2, 0.3], [1.1, 2.1, np.nan, 0.3, 0.4]]
    one = Measurements.of(ROBOT, columns, values, [0.0, 1e-4, 1e-5, 1e-4, 1e-5])
    again = read(one.text().replace(",", mark))
    np.testing.assert_allclose(again.values, values, rtol=1e-9)
    np.testing.assert_allclose(again.sigmas, one.sigmas, rtol=1e-9)
    assert again.quantities == one.quantities
    np.testing.assert_allclose(again.quantities[4].reference, [0.0, 0.6, 0.8])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "m.csv: the file is empty"),
        ("joint1,joint3\n1,2\n", "m.csv, line 1: the first column is 'pose', the names of the poses, not 'joint1'"),
        ("pose,jonit1\n", "m.csv, line 1, column 2: 'jonit1' is neither a joint (joint1, joint2, joint3 ...)"),
        ("pose,tol.x\n", "has no node 'tol': did you mean 'tool'?"),
        ("pose,tool.distance\n", "distance takes a fixed point or a direction in parentheses"),
        ("pose,tool.distance(1 2mm 3)\n", "can be read two ways"),
        ("pose,tool.distance(5000 0 0)\n", "is in m, which can't be meant: write the unit, such as 5000mm"),
        ("pose,tool.x [deg]\n", "line 1, column 2: tool.x: [deg] is an angle: a length is wanted"),
        ("pose,joint1,tool.x [mm]\na,1\n", "line 2: 2 cells, but the header has 3 columns"),
        ("pose,joint1,tool.x [mm]\n\na,1,2\n", "line 3, column tool.x: no sigma is given"),
        ("pose,joint1,tool.x [mm]\nsigma,,0\n", "line 2, column tool.x: a standard deviation is above 0"),
        ("pose,joint1,tool.x [mm]\nsigma,,1\na,x,2\n", "line 3, column joint1: 'x' is not an angle"),
        ("pose;joint1;tool.x [mm]\nsigma;;0,05\n", "line 2, column tool.x: '0,05' has a decimal comma: write 0.05"),
        ("pose,joint1,tool.x [mm]\na,1,5,312,25\n", "5 cells, but the header has 3 columns: write decimal points"),
        ("pose,joint1,tool.x\nsigma,,0.05mm\na,1,312\n", "312 mm? (the header gives no unit: write tool.x [mm])"),
    ],
)  # fmt: skip
def test_mistakes_are_named(text, message):
    with pytest.raises(DesignError) as caught:
        read(text)
    assert message in str(caught.value)
