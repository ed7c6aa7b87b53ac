"""The recipes of docs/joints.md: axes are where Pinocchio's Jacobians have them."""

import re

import numpy as np
import pinocchio as pin
import pytest
from pages import ROOT

import cinegen

TEXT = (ROOT / "docs/joints.md").read_text(encoding="utf-8")
CARDS = {
    title: (raff, [[cell.strip() for cell in row.split("|")[1:-1]] for row in rows.splitlines()])
    for title, raff, rows in re.findall(
        r"^## ([^\n]+)\n.*?^```raff [^\n]+\n(.*?)^```.*?^\| joint \|[^\n]+\n\|[-| ]+\|\n((?:\|[^\n]+\n)+)",
        TEXT,
        flags=re.DOTALL | re.MULTILINE,
    )
}
MOBILITY = {"Two parallel axes": 2, "An axis at right angles": 2, "A ball": 3, "A universal joint": 2}
ROUNDED = 5.001e-6, 5.001e-5  # m and 1: half of the last digit of a position and of a direction


def number(text: str) -> float:
    return float(text.replace("−", "-").rstrip("°"))


def vector(text: str) -> np.ndarray:
    return np.array([number(part) for part in text.strip("()").split(",")])


@pytest.fixture(params=CARDS, scope="module")
def card(request, tmp_path_factory):
    """Title, mechanism, and rows of the table by joint."""
    raff, rows = CARDS[request.param]
    path = tmp_path_factory.mktemp("card") / "card.raff"
    path.write_text(raff, encoding="utf-8")
    return (request.param, cinegen.load(path), {row[0].strip("`"): row[1:] for row in rows})


def test_there_are_twelve_recipes():
    assert len(CARDS) == len(re.findall("^## ", TEXT, flags=re.MULTILINE)) == 12


def test_the_axes_are_where_the_card_says(card):
    _, mechanism, rows = card
    model, data = mechanism.model, mechanism.model.createData()
    pin.computeJointJacobians(model, data, mechanism.q_home)
    pin.updateFramePlacements(model, data)
    assert {row for row in rows if row != "pin"} == set(mechanism.joints) | set(mechanism.balls)
    for joint, (through, along) in rows.items():
        point = 1e-3 * vector(through)
        if joint == "pin":
            first, second = (data.oMf[model.getFrameId(name)] for name in ("frame4", "frame5"))
            assert np.allclose(first.translation, second.translation, rtol=0.0, atol=1e-9)
            assert np.allclose(first.translation, point, rtol=0.0, atol=ROUNDED[0])
            assert np.allclose(first.rotation[:, 2], vector(along), rtol=0.0, atol=ROUNDED[1])
            continue
        if along == "all directions":
            assert np.allclose(data.oMi[model.getJointId(joint)].translation, point, rtol=0.0, atol=ROUNDED[0])
            continue
        number_of_joint = model.getJointId(joint)
        column = model.joints[number_of_joint].idx_v
        jacobian = pin.getJointJacobian(model, data, number_of_joint, pin.ReferenceFrame.WORLD)
        twist = jacobian.reshape(6, model.nv)[:, column]
        linear, angular = twist[:3], twist[3:]
        if mechanism.is_prismatic(joint):
            assert np.allclose(linear, vector(along), rtol=0.0, atol=ROUNDED[1])
            arm = data.oMi[number_of_joint].translation - point  # it slides along the line that the card states
            assert np.linalg.norm(np.cross(arm, linear)) < ROUNDED[0]
        else:
            assert np.allclose(angular, vector(along), rtol=0.0, atol=ROUNDED[1])
            assert np.allclose(linear, np.cross(point, angular), rtol=0.0, atol=2.0 * ROUNDED[0])


def test_the_mobility_is_that_of_the_joint(card):
    title, mechanism, _ = card
    assert mechanism.mobility == MOBILITY.get(title, 1)
