"""The mechanism tells which bodies have no mass, and which masses are no body's."""

import re
from pathlib import Path

import pytest

import cinegen
from cinegen.model.build import build

UNIT = '<inertia ixx="{}" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'


def inertial(mass: float, ixx: float = 1.0) -> str:
    return f'<inertial><mass value="{mass}"/>{UNIT.format(ixx)}</inertial>'


def chain(tmp_path: Path, links: dict[str, str], kinds: list[str]) -> Path:
    """Write a URDF of links one behind another, with joints of the kinds between them."""
    names = list(links)
    text = "".join(f'<link name="{name}">{inner}</link>' for name, inner in links.items())
    for parent, child, kind in zip(names, names[1:], kinds, strict=False):
        ends = f'<parent link="{parent}"/><child link="{child}"/><axis xyz="0 0 1"/>'
        text += f'\n<joint name="to_{child}" type="{kind}">{ends}</joint>'
    path = tmp_path / "chain.urdf"
    path.write_text(f'<robot name="chain">\n{text}</robot>')
    return path


def test_a_body_has_the_mass_of_any_link_on_it(tmp_path: Path) -> None:
    links = {"base": "", "arm": "", "flange": inertial(2.0), "hand": "", "finger": ""}
    mechanism = cinegen.load(chain(tmp_path, links, ["continuous", "fixed", "continuous", "fixed"]))
    assert mechanism.massless == ("hand",)
    assert mechanism.model.inertias[mechanism.model.getJointId("to_arm")].mass == 2.0


def test_a_stated_mass_of_0_is_known(tmp_path: Path) -> None:
    cross = inertial(0.0).replace('"1', '"0').replace('"1.0', '"0')
    links = {"base": "", "cross": cross, "hand": inertial(1.0)}
    assert cinegen.load(chain(tmp_path, links, ["continuous"] * 2)).massless == ()


def test_a_body_that_a_rigid_loop_cut_has_the_mass_of_either_half() -> None:
    """The platform of a delta robot is link 5, and the last bodies of the two other arms."""
    given = cinegen.load("delta4")
    urdf = re.sub("<inertial>.*?</inertial>", "", given.source.urdf, flags=re.DOTALL)
    before = build(urdf, given.source.constraints)
    text = urdf.replace('<link name="link5">', f'<link name="link5">{inertial(1.5)}')
    assert text != urdf
    mechanism = build(text, before.source.constraints)
    assert set(before.massless) - set(mechanism.massless) >= {"link5", "link10", "link16"}


@pytest.mark.parametrize(("mass", "ixx", "why"), [
    (1.0, -0.1, "a principal moment of inertia is negative, -0.1 kg m2"),
    (1.0, 2.1, "a principal moment of inertia, 2.1 kg m2, exceeds the sum of the others, 1 and 1"),
    (0.0, 1.0, "it has moments of inertia, up to 1 kg m2, but no mass: state its mass"),
])  # fmt: skip
def test_an_inertia_that_no_body_has_is_named_with_the_reason(
    tmp_path: Path, mass: float, ixx: float, why: str
) -> None:
    links = {"base": "", "arm": inertial(mass, ixx)}
    path = chain(tmp_path, links, ["continuous"])
    with pytest.warns(cinegen.CinegenWarning, match="link 'arm'.*no body can have"):
        mechanism = cinegen.load(path)
    assert mechanism.unphysical == {"arm": why}
