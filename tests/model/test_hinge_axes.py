"""Hinges of loops are about z; messages name the axis where the frames that a person wrote have another one."""

import math
import re
from pathlib import Path

import pytest

import cinegen
from cinegen.model.forward import ForwardKinematics

AXIS = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}


def place(axis: str, along: float, up: float) -> str:
    """A point of the plane that is normal to an axis."""
    return {"x": f"0 {along} {up}", "y": f"{along} 0 {up}", "z": f"{along} {up} 0"}[axis]


def four_bar(path: Path, axis: str, first: str = "0 0 0", second: str = "0 0 0") -> Path:
    """A four-bar whose joints are about an axis; the frames that close it have these rpy."""
    links = ("ground", "crank", "coupler", "rocker", "closing_pin_1", "closing_pin_2")
    lines = ['<robot name="bars">', *(f'<link name="{name}"/>' for name in links)]
    for parent, child, along, up in (
        ("ground", "crank", 0, 0),
        ("crank", "coupler", 0, 0.1),
        ("ground", "rocker", 0.3, 0),
    ):
        lines.append(
            f'<joint name="to_{child}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{place(axis, along, up)}"/><axis xyz="{AXIS[axis]}"/></joint>'
        )
    for parent, child, along, up, rpy in (
        ("coupler", "closing_pin_1", 0.35, 0.2, first),
        ("rocker", "closing_pin_2", 0.05, 0.3, second),
    ):
        lines.append(
            f'<joint name="to_{child}" type="fixed"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{place(axis, along, up)}" rpy="{rpy}"/></joint>'
        )
    path.write_text("\n".join([*lines, "</robot>"]), encoding="utf-8")
    return path


HINGE = {"closing_pin": "revolute"}


@pytest.mark.parametrize("axis", ["x", "y"])
def test_a_hinge_about_another_axis_than_the_joints_is_refused_and_the_remedy_works(axis, tmp_path):
    path = four_bar(tmp_path / "bars.urdf", axis)
    ball = cinegen.load(path)
    assert ball.mobility == 1
    with pytest.raises(cinegen.CinegenError, match=f"takes 1 DoF .* that it leaves about their {axis} axes") as caught:
        cinegen.load(path, loops=HINGE)
    (rpy,) = re.findall('rpy="([^"]*)"', str(caught.value))
    assert cinegen.load(four_bar(path, axis, rpy, rpy), loops=HINGE).mobility == 1


def test_frames_whose_axes_point_against_each_other_are_told_and_the_remedy_works(tmp_path):
    opposed = f"{math.pi} 0 0"
    path = four_bar(tmp_path / "bars.urdf", "z", second=opposed)
    with pytest.raises(cinegen.ClosureError) as caught:
        cinegen.load(path, loops=HINGE)
    said = str(caught.value)
    assert "(revolute, 180 degrees between its axes)" in said
    assert "It closes with the frame of closing_pin_2 turned by 180 degrees about its x" in said
    assert cinegen.load(four_bar(path, "z"), loops=HINGE).mobility == 1


def test_the_remedy_for_an_open_configuration_works(robot):
    mechanism = robot("five_bar")
    q = mechanism.q_home + 0.01
    for made in (cinegen.Solver(mechanism, 0.01), ForwardKinematics(mechanism)):
        with pytest.raises(cinegen.CinegenError, match=r"open by .*: use mechanism\.close\(q\)$"):
            made.q = q
        made.q = mechanism.close(q)
        assert mechanism.closure(made.q) <= 1e-10
