"""Files that are made to break a reader: each is refused with a message, at once, and without a word of others."""

import json
import os
import re
import warnings
from pathlib import Path

import pytest

import cinegen
import raff2urdf
from cinegen.errors import CinegenError
from raff2urdf import RaffError, RaffWarning
from raff2urdf.errors import did_you_mean
from raff2urdf.readers import read

URDF = """<robot name="r">
<link name="a"/><link name="b"/><link name="c"/>
<joint name="j" type="continuous"><parent link="a"/><child link="b"/>{0}</joint>
<joint name="k" type="continuous"><parent link="b"/><child link="c"/></joint>
{1}</robot>"""
BODY = '<mujoco><worldbody><body name="a" {0}><joint name="j" {1}/><geom size="1"/></body></worldbody></mujoco>'
HINGE = "closures: [{link_a: a, link_b: c, point: [0, 0, 0], axis: [0, 0, 1]}]\n"


def refused(folder: Path, message: str, **files: str) -> None:
    """Write files, the first of which is the robot's, and check the error."""
    for name, text in files.items():
        (folder / name.replace("__", ".")).write_text(text, encoding="utf-8")
    path = folder / next(iter(files)).replace("__", ".")
    with warnings.catch_warnings(action="error"), pytest.raises((RaffError, CinegenError), match=message):
        cinegen.load(path)


# --- numbers -----------------------------------------------------------------------------------------------------


def test_an_mjcf_with_an_error_leaves_the_next_one_readable(tmp_path: Path) -> None:
    """MuJoCo 4.0 did not end at a warning after this error."""
    equality = '<equality><connect body1="a" anchor=""/></equality></mujoco>'
    refused(tmp_path, "can't read it", r__xml=BODY.format("", "").replace("</mujoco>", equality))
    said = "geom 'geom0' of body 'a': its rgba must be four numbers, not .nan"
    refused(tmp_path, said, r__xml=BODY.format("", '/><geom rgba="nan 0 0 1" size="1"'))


@pytest.mark.parametrize(("attributes", "message"), [
    (("", 'axis="0 1e308 1e308"'), "the orientation of a joint is not a rotation"),
    (("", 'pos="0 0 1e308"'), "a number of a joint is beyond"),
])  # fmt: skip
def test_numbers_of_mjcf(tmp_path: Path, attributes: tuple[str, str], message: str) -> None:
    refused(tmp_path, message, r__xml=BODY.format(*attributes))


@pytest.mark.parametrize(("what", "message"), [
    ("ratio -1e308", r":3:24: what link 1 adds to link 2 has coefficients beyond 1e\+12 in SI units, or all below"),
    ("ratio 1e-13", "all below 1e-12"),
    (f"polynomial ( {300 * '1e300 '})", r"beyond 1e\+12"),  # divided by a power of a degree, which is 0
    ("ratio 1 offset -1e308", r"r.raff:3:41: the 'offset' of link 2 in a coupling is beyond 1e\+12"),
], ids=["too-large", "too-small", "too-many-powers", "offset"])  # fmt: skip
def test_numbers_of_couplings_in_raff(tmp_path: Path, what: str, message: str) -> None:
    coupling = f"coupling {{ link 2 link 1 {what} }}"
    text = f"RAFF x\nrobot r {{ base {{ }} link 1 {{ type 2 pred 0 }} link 2 {{ type 2 pred 1 }}\n{coupling} }}"
    refused(tmp_path, message, r__raff=text)


def test_a_velocity_limit_that_would_be_taken_for_none(tmp_path: Path) -> None:
    urdf = URDF.format('<limit effort="1" velocity="1e-13"/>', "")
    message = "velocity limit of {0} is 1e-13: it must be above 0, and not as slow as 1e-12 rad/s or m/s"
    refused(tmp_path, message.format("joint 'j'"), r__urdf=urdf)
    raff = "RAFF x\nrobot r { base { } link 1 { type 2 pred 0 velocity 1e-13 } }"
    refused(tmp_path, message.format("link 1"), r__raff=raff)


def of_b(content: str) -> str:
    """A URDF whose link b has some content, which begins on line 2."""
    return URDF.format("", "").replace('<link name="b"/>', f'<link name="b">{content}</link>')


SHAPE = "<visual>\n<geometry>{}</geometry></visual>"
MASS = '<inertial>\n<mass value="{}"/></inertial>'


@pytest.mark.parametrize(("content", "message"), [
    (SHAPE.format('<box size="1 1"/>'), "size=\"1 1\" of <box> in link 'b' must be 3 numbers"),
    (SHAPE.format('<mesh filename="a.stl" scale="1 1"/>'), "scale=\"1 1\" of <mesh> in link 'b' must be 3 numbers"),
    (SHAPE.format('<sphere radius="1e308"/>'), "radius=\"1e308\" of <sphere> in link 'b' must be a number"),
    *((MASS.format(mass), f"value=\"{mass}\" of <mass> in link 'b' must be a number") for mass in ("1,5", "nan", "")),
])  # fmt: skip
def test_shapes_and_masses(tmp_path: Path, content: str, message: str, capfd: pytest.CaptureFixture[str]) -> None:
    """URDF's own parser prints an error, and leaves them out or goes on."""
    refused(tmp_path, f"r.urdf:3: {message}", r__urdf=of_b(content))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("inertia", "lacks"), [
    ("", "inertia"), ('<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"/>', "izz of <inertia>"),
])  # fmt: skip
def test_an_incomplete_mass_is_reported(inertia: str, lacks: str, capfd: pytest.CaptureFixture[str]) -> None:
    text = of_b(f'<inertial><mass value="1"/>{inertia}</inertial>')
    with pytest.warns(cinegen.CinegenWarning, match=f":2: the <inertial> of link 'b' has no {lacks}: its mass is"):
        cinegen.load(text)
    assert capfd.readouterr() == ("", "")


# --- structure ---------------------------------------------------------------------------------------------------

ENTITIES = "".join(f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(9))
LAUGHS = f'<!DOCTYPE l [<!ENTITY a "aaaaaaaaaa">{ENTITIES}]>'


@pytest.mark.parametrize(("text", "message"), [
    (LAUGHS + '<robot name="r"><link name="&j;"/></robot>', "amplification factor exceeded"),
    (LAUGHS + '<robot name="r"><link name="a">&j;</link></robot>', "amplification factor exceeded|is not read"),
    ('<xacro:robot name="r"/>', "its first element is <xacro:robot>: this is not a robot"),
])  # fmt: skip
def test_xml(tmp_path: Path, text: str, message: str) -> None:
    refused(tmp_path, message, r__urdf=text)


@pytest.mark.parametrize(("text", "message"), [
    ("closures: " + 1500 * "[", r":1: its values are nested too deeply"),
    (HINGE.replace("0, 0, 1", "9" * 5000 + ", 0, 1"), "Exceeds the limit"),
    (HINGE.replace("[0, 0, 1]", "!!python/object/apply:os.getcwd []"), "could not determine a constructor"),
    ("# a c\n" * 400_000, "is larger than 2 MB"),
])  # fmt: skip
def test_yaml(tmp_path: Path, text: str, message: str) -> None:
    refused(tmp_path, message, r__urdf=URDF.format("", ""), loop_closures__yaml=text)


def sidecar(**values: object) -> str:
    joints = [{"name": "j", "home": 0}, {"name": "k", "home": 0}]
    head = {"format": "raff2urdf constraints", "version": 2, "robot": "r", "nodes": ["a", "b", "c"]}
    return json.dumps(head | {"joints": joints, "loops": [], "mobility": 2} | values)


@pytest.mark.parametrize(("values", "message"), [
    ({"loops": json.loads(900 * "[" + 900 * "]")}, r"\$.loops\[0\]: "),
    ({"nodes": [f"{i:04}" for i in range(600_000)]}, "constraints.json: is not read: it is larger than 4 MB"),
])  # fmt: skip
def test_constraints(tmp_path: Path, values: dict[str, object], message: str) -> None:
    refused(tmp_path, message, r__urdf=URDF.format("", ""), r__constraints__json=sidecar(**values))


COUPLING = re.compile("<raff:term.*(?=</raff:coupling>)", re.DOTALL)


@pytest.fixture(scope="module")
def scara(root: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """A robot with couplings as SDF."""
    with pytest.warns(RaffWarning, match="SDF has no notation for screw"):
        (conversion,) = raff2urdf.convert(root / "robots/scara.raff", tmp_path_factory.mktemp("scara"), format="sdf")
    return conversion.file.read_text()


@pytest.mark.parametrize(("old", "new", "why"), [
    ("raff:robot", "orbot", r"<raff:joint> would be lost: only the element <raff:robot> of the <model> is read"),
    ("xmlns:raff", "xmlns:raf", '<raff:robot> would be lost: .* with the namespace xmlns:raff="urn:raff2urdf"'),
    ("</model>", "<raff:robot/></model>", "<raff:robot> would be lost: there is one already"),
    (COUPLING, '<!-- --><raff:term joint="joint4" coefficients="0 0"/>',
     "raff:coupling 'screw': the coefficients of 'joint4' are 0"),
    (COUPLING, '<!-- --><raff:term joint="joint4" coefficients="a"/>',
     "raff:coupling 'screw' must have numbers, and names of joints that move"),
    (COUPLING, '<!-- --><raff:term joint="oint4" coefficients="1"/>',
     "raff:coupling 'screw' must have numbers, .* did you mean 'joint4'"),
])  # fmt: skip
def test_own_elements_of_an_sdf_are_read_or_refused(scara: str, tmp_path: Path, old, new: str, why: str) -> None:
    text = scara.replace(old, new) if isinstance(old, str) else old.sub(new, scara)
    refused(tmp_path, rf"scara.sdf:\d+: {why}", scara__sdf=text)


def test_own_elements_of_a_urdf_are_read_or_refused(root: Path, tmp_path: Path) -> None:
    (conversion,) = raff2urdf.convert(root / "robots" / "four_bar.raff", tmp_path, dialect="constraint")
    (tmp_path / "four_bar.constraints.json").unlink()
    text = conversion.file.read_text().replace("raff:robot", "raff:orbot")
    refused(tmp_path, r"four_bar.urdf:\d+: <raff:orbot> would be lost", four_bar__urdf=text)


def test_words_of_any_length_are_compared_at_once() -> None:
    assert did_you_mean("a" * 1_000_000, ["b" * 1_000_000]) == f" (known: {'b' * 100})"
    assert did_you_mean("alpah", ["alpha"] * 100_000) == ": did you mean 'alpha'?"


# --- files that are none -----------------------------------------------------------------------------------------


def test_devices_and_pipes_next_to_a_urdf(tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text(URDF.format("", ""))
    for name in ("robot.yaml", "loop_closures.yaml"):
        os.mkfifo(tmp_path / name)
        assert read(tmp_path / "r.urdf").constraints is None
    os.mkfifo(tmp_path / "r.constraints.json")
    refused(tmp_path, "r.constraints.json: is not a file", r__urdf=URDF.format("", ""))


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no /dev/zero")
@pytest.mark.parametrize("name", ["r.urdf", "r.raff", "r.sdf", "r.xml"])
def test_a_file_without_an_end(tmp_path: Path, name: str) -> None:
    (tmp_path / name).symlink_to("/dev/zero")
    with pytest.raises((RaffError, CinegenError), match="this is a device, not a file"):
        cinegen.load(tmp_path / name)


def test_a_file_of_gigabytes(tmp_path: Path) -> None:
    with open(tmp_path / "r.urdf", "wb") as file:
        file.truncate(300_000_000)
    with pytest.raises(cinegen.CinegenError, match=r"r\.urdf: is not read: it is larger than 256 MB"):
        cinegen.load(tmp_path / "r.urdf")


@pytest.mark.parametrize("element", ["<include file='{0}'/>", "<asset><model name='x' file='{0}'/></asset>"])
def test_mjcf_includes_files_near_it_only(tmp_path: Path, element: str) -> None:
    folder = tmp_path / "some" / "robot"
    folder.mkdir(parents=True)
    (tmp_path / "secret.xml").write_text("<mujocoinclude/>")
    (folder / "link.xml").symlink_to(tmp_path / "secret.xml")
    os.mkfifo(folder / "pipe.xml")
    body = BODY.format("", "").removeprefix("<mujoco>")
    for file in ("../../secret.xml", str(tmp_path / "secret.xml"), "link.xml"):
        refused(folder, rf"r.xml:1: the file '{file}' leads out of", r__xml="<mujoco>" + element.format(file) + body)
    refused(folder, "'pipe.xml' is not a regular file", r__xml="<mujoco>" + element.format("pipe.xml") + body)


def test_an_error_lists_twenty_problems() -> None:
    links = "\n".join(f"link {i} {{ type 7 pred 0 }}" for i in range(1, 100))
    with pytest.raises(RaffError, match=r"and 79 more$") as caught:
        cinegen.load(f"RAFF x\nrobot r {{ base {{ }}\n{links}\n}}")
    assert len(caught.value.problems) == 99


def test_an_error_quotes_some_of_a_long_text() -> None:
    with pytest.raises(CinegenError, match="is not a number") as error:
        cinegen.load(URDF.format(f'<limit velocity="1e{"a" * 1_000_000}"/>', ""))
    assert len(str(error.value)) < 5000
