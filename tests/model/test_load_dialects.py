"""Each dialect of loops and couplings in URDFs: mobility as counted by hand, closed at every tick of a drag.

Four bars in the xy plane, with all joints at 0: the crank is upright, the coupler lies on it, the rocker leans to it.

    ground (0, 0) -- crank --> (0, 1) -- coupler --> (2, 1) = P <-- rocker -- (2.5, 0) ground

Three revolute joints about z move in the plane. A pin at P takes two degrees of freedom: one remains.
"""

import json
import re
import warnings

import numpy as np
import pytest
from dragging import dragged
from urdf_text import BARS, joint_at, joint_text, limit, links, robot

import cinegen
import raff2urdf
from cinegen import CinegenError
from cinegen.collision import load_scene
from raff2urdf.errors import RaffWarning

ENDS = '<parent link="coupler"/><child link="rocker"/>'
SDF_ENDS = "<parent>coupler</parent><child>bars::rocker</child>"
ON_COUPLER, ON_ROCKER = "2 0 0", "-0.5 1 0"
FRAME = (
    '<link name="{0}"/><joint name="{0}_frame" type="fixed"><parent link="{1}"/><child link="{0}"/><origin xyz="{2}"/>'
    "</joint>"
)
TIP = FRAME.format("tip", "coupler", ON_COUPLER)
SECOND = f'<parent link="rocker"/><child link="tip"/><origin xyz="{ON_ROCKER}"/><axis xyz="0 0 1"/>'
PAIR = FRAME.format("closing_pin_1", "coupler", ON_COUPLER) + FRAME.format("closing_pin_2", "rocker", ON_ROCKER)

LOOPS = {
    "URDF+": (
        f'<loop name="pin" type="revolute"><predecessor link="coupler"><origin xyz="{ON_COUPLER}"/></predecessor>'
        f'<successor link="rocker"><origin xyz="{ON_ROCKER}"/></successor><axis xyz="0 0 1"/></loop>',
        "URDF+", "pin", "revolute",
    ),
    "URDF+, exported": (
        f'<constraint name="pin" type="continuous"><axis xyz="0 0 1"/><predecessor link="coupler">'
        f'<origin xyz="{ON_COUPLER}"/></predecessor><successor link="rocker"><origin xyz="{ON_ROCKER}"/></successor>'
        "</constraint>",
        "constraint elements", "pin", "revolute",
    ),
    "proposal to ROS": (
        f'<constraint name="pin" type="revolute">{ENDS}<parent_origin xyz="{ON_COUPLER}"/><parent_axis xyz="0 0 1"/>'
        f'<child_origin xyz="{ON_ROCKER}"/><child_axis xyz="0 0 1"/></constraint>',
        "constraint elements", "pin", "revolute",
    ),
    "Isaac Sim": (
        f'<loop_joint name="pin" type="spherical"><link1 link="coupler" rpy="0 0 0" xyz="{ON_COUPLER}"/>'
        f'<link2 link="rocker" rpy="0 0 0" xyz="{ON_ROCKER}"/></loop_joint>',
        "loop_joint elements", "pin", "ball",
    ),
    "Isaac Sim, as documented": (
        f'<loop_joint name="pin" type="spherical"><link1 link="coupler" xyz="{ON_COUPLER}"/>'
        f'<link1 link="rocker" xyz="{ON_ROCKER}"/></loop_joint>',
        "loop_joint elements", "pin", "ball",
    ),
    "Fusion 360": (
        f'<loop_joint name="pin" type="revolute">{ENDS}<parent_origin xyz="{ON_COUPLER}"/>'
        f'<child_origin xyz="{ON_ROCKER}"/><axis xyz="0 0 1" frame="parent"/></loop_joint>',
        "loop_joint elements", "pin", "revolute",
    ),
    "onshape-to-robot": (PAIR, "closing frames", "closing_pin", "ball"),
    "onshape-to-robot, hinge": (
        PAIR
        + FRAME.format("closing_pin_1_z", "coupler", "2 0 .1")
        + FRAME.format("closing_pin_2_z", "rocker", "-.5 1 .1"),
        "closing frames", "closing_pin", "revolute",
    ),
    "frames with a prefix": (
        f'<frame name="left/closing_pin_1" link="coupler" xyz="{ON_COUPLER}"/>'
        f'<frame name="left/closing_pin_2" link="rocker" xyz="{ON_ROCKER}"/>',
        "closing frames", "left/closing_pin", "ball",
    ),
    "second parent": (
        f'{TIP}<joint name="pin" type="continuous">{SECOND}</joint>',
        "second parents", "pin", "revolute",
    ),
    "Drake's second parent": (
        f'{TIP}<drake:joint name="pin" type="revolute">{SECOND}</drake:joint>',
        "second parents", "pin", "revolute",
    ),
    "Drake constraint": (
        '<drake:ball_constraint><drake:ball_constraint_body_A name="coupler"/>'
        f'<drake:ball_constraint_body_B name="rocker"/><drake:ball_constraint_p_AP value="{ON_COUPLER}"/>'
        f'<drake:ball_constraint_p_BQ value="{ON_ROCKER}"/></drake:ball_constraint>',
        "Drake", "coupler-rocker", "ball",
    ),
    "Drake bushing": (
        f'<frame name="a" link="coupler" xyz="{ON_COUPLER}"/><frame name="c" link="rocker" xyz="{ON_ROCKER}"/>'
        '<drake:linear_bushing_rpy><drake:bushing_frameA name="a"/><drake:bushing_frameC name="c"/>'
        '<drake:bushing_torque_stiffness value="3e4 3e4 0"/><drake:bushing_torque_damping value="1 1 0"/>'
        '<drake:bushing_force_stiffness value="3e4 3e4 3e4"/><drake:bushing_force_damping value="1 1 1"/>'
        "</drake:linear_bushing_rpy>",
        "Drake", "coupler-rocker", "revolute",
    ),
    "Gazebo joint": (
        f'<gazebo><joint name="pin" type="revolute">{SDF_ENDS}<pose>{ON_ROCKER} 0 0 0</pose>'
        "<axis><xyz>0 0 1</xyz></axis></joint></gazebo>",
        "Gazebo joints", "pin", "revolute",
    ),
}  # fmt: skip


@pytest.fixture
def write(text_file):
    return lambda added="", base=BARS: text_file("bars.urdf", f"{base}{added}\n</robot>")


@pytest.mark.parametrize("dialect", LOOPS)
def test_a_loop_of_each_dialect_is_closed(dialect, write):
    added, name, loop, kind = LOOPS[dialect]
    with warnings.catch_warnings(action="error"):
        mechanism = cinegen.load(write(added))
    assert (mechanism.mobility, mechanism.joints) == (1, ("drive", "elbow", "swing"))
    assert mechanism.actuated == ("drive",)
    assert [(closed_loop.name, closed_loop.kind.name.lower()) for closed_loop in mechanism.loops] == [(loop, kind)]
    assert mechanism.gap_as_written <= 1e-15  # all joints at 0 is closed
    assert mechanism.source.dialects == (name,)
    closure, farthest = dragged(mechanism)
    assert closure <= 1e-10
    assert farthest > 0.3


# Of each kind of joint: equations that bind the three joints of the plane, counted by hand.
KINDS = {
    "fixed": 3,  # x, y, the angle
    "prismatic": 2,  # y, the angle: the axis is x
    "revolute": 2,  # x, y
    "spherical": 2,
    "universal": 2,
    "cylindrical": 2,
    "planar": 0,  # the plane that they move in
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("element", "dialect"), [
    ("loop", "URDF+"), ("constraint", "proposal to ROS"), ("loop_joint", "Isaac Sim"),
])  # fmt: skip
def test_each_kind_of_joint_closes_a_loop(kind, element, dialect, write):
    axis = "1 0 0" if kind == "prismatic" else "0 0 1"
    axes = f'<axis xyz="{axis}"/><axis2 xyz="1 0 0"/>'
    if element == "constraint":
        axes = f'<parent_axis xyz="{axis}"/><child_axis xyz="{"1 0 0" if kind == "universal" else axis}"/>'
    text = re.sub("<axis.*?/>|<parent_axis.*?/>|<child_axis.*?/>", "", LOOPS[dialect][0])
    text = re.sub('type="[a-z]*"', f'type="{kind}"', text).replace(f"</{element}>", f"{axes}</{element}>")
    mechanism = cinegen.load(write(text))
    assert mechanism.mobility == 3 - KINDS[kind]
    assert set(mechanism.actuated) <= {"drive", "elbow", "swing"}
    assert mechanism.mobility == 0 or dragged(mechanism, 60)[0] <= 1e-10


# --- joints and plugins for Gazebo ---------------------------------------------------------------------------------


def test_the_axis_of_a_gazebo_joint_is_in_its_own_frame_unless_told_otherwise(write):
    """The joint's frame is rotated by 90 degrees about x: the normal of the plane is its y."""
    joint = f'<joint name="pin" type="revolute">{SDF_ENDS}<pose>{ON_ROCKER} {np.pi / 2} 0 0</pose><axis>'
    for axis in (
        "<xyz>0 1 0</xyz>",
        "<xyz>0 0 1</xyz><use_parent_model_frame>1</use_parent_model_frame>",
        '<xyz expressed_in="ground">0 0 1</xyz>',
        '<xyz expressed_in="__model__">0 0 1</xyz>',
    ):
        mechanism = cinegen.load(write(f"<gazebo>{joint}{axis}</axis></joint></gazebo>"))
        assert mechanism.mobility == 1
        assert mechanism.gap_as_written < 1e-15
    mechanism = cinegen.load(write(f"<gazebo>{joint}<xyz>0 0 1</xyz></axis></joint></gazebo>"))
    assert mechanism.mobility == 0  # a hinge in the plane


JACK = """<robot name="jack">
  <link name="frame"/> <link name="carriage"/> <link name="spindle"/>
  <joint name="lift" type="prismatic"> <parent link="frame"/> <child link="carriage"/> <axis xyz="0 0 1"/>
    <origin xyz="0 0 0.5"/> <limit lower="-1" upper="1" effort="1" velocity="1"/> </joint>
  <joint name="motor" type="continuous"> <parent link="frame"/> <child link="spindle"/> <axis xyz="0 0 1"/> </joint>
"""


@pytest.mark.parametrize(("pitch", "rise"), [
    ("<screw_thread_pitch>0.006</screw_thread_pitch>", 0.006),  # m per revolution, right-handed
    ("<thread_pitch>1000</thread_pitch>", -2e-3 * np.pi),  # rad per m, left-handed
])  # fmt: skip
def test_a_gazebo_joint_may_be_a_screw(pitch, rise, write):
    """A carriage on a spindle: `rise` is the way of the spindle in the carriage by a revolution."""
    joint = '<joint name="nut" type="screw"><parent>carriage</parent><child>spindle</child>'
    jack = cinegen.load(write(f"<gazebo>{joint}<axis><xyz>0 0 1</xyz></axis>{pitch}</joint></gazebo>", JACK))
    assert jack.mobility == 1
    inner = {"nut_TZ": rise, "nut_Z": 2.0 * np.pi, "motor": 2.0 * np.pi}
    assert jack.closure(jack.configuration({"lift": -rise, **inner})) < 1e-12
    assert jack.closure(jack.configuration({"lift": rise, **inner})) > 1e-3


@pytest.mark.parametrize("pitch", ["<thread_pitch>0</thread_pitch>", "<screw_thread_pitch>six</screw_thread_pitch>"])
def test_a_screw_needs_a_pitch(pitch, write):
    joint = '<joint name="nut" type="screw"><parent>carriage</parent><child>spindle</child>'
    with pytest.raises(CinegenError, match=r":6: the (screw_)?thread_pitch of <joint> 'nut' must be a number"):
        cinegen.load(write(f"<gazebo>{joint}{pitch}</joint></gazebo>", JACK))


def test_links_that_only_gazebo_has_are_told_and_left_out_with_their_joints(write):
    joint = '<joint name="{0}-{1}" type="revolute"><parent>{0}</parent><child>{1}</child></joint>'
    rod = '<link name="rod"><pose>0 0 0 0 0 0</pose></link>'
    joints = joint.format("crank", "rod") + joint.format("rod", "rocker")
    mechanism = cinegen.load(write(f"<gazebo>{rod}{joints}</gazebo>"))
    assert mechanism.mobility == 3
    assert mechanism.source.notes == ("not read: <link> 'rod' in <gazebo> (line 6), and its joints",)


def test_the_closed_loop_plugin_is_a_hinge_about_y(write):
    upright = BARS.replace('xyz="0 0 1"', 'xyz="0 1 0"').replace('<origin xyz="0 1 0"/>', '<origin xyz="0 0 1"/>')
    for rotation in ("<rotation>0 0 0.7</rotation>", ""):
        inside = f"<joint>pin</joint>{SDF_ENDS}<position>-0.5 0 1</position>{rotation}"
        file = "libpegasus_gazebo_closed_loop_plugin.so"
        plugin = f'<gazebo><plugin name="Closed" filename="{file}">{inside}</plugin></gazebo>'
        mechanism = cinegen.load(write(plugin, upright))
        assert [(loop.name, loop.kind.name) for loop in mechanism.loops] == [("pin", "REVOLUTE")]
        assert (mechanism.mobility, mechanism.source.dialects) == (1, ("Gazebo plugins",))


# --- what URDF+ says of joints -----------------------------------------------------------------------------------


def test_urdf_plus_tells_which_joints_are_passive(write):
    base = BARS
    for joint, independent in (("drive", "false"), ("elbow", "false"), ("swing", "true")):
        base = base.replace(f'"{joint}" type', f'"{joint}" independent="{independent}" type')
    assert cinegen.load(write(LOOPS["URDF+"][0], base)).actuated == ("swing",)


def test_a_rotor_of_urdf_plus_turns_with_its_gear_on_a_base_that_floats(write):
    parts = [links("world", "hull", "leg", "rotor"), joint_text("free", "world", "hull", kind="floating")]
    parts += [joint_text("hip", "hull", "leg")]
    parts += [joint_text("spin", "hull", "rotor").replace(" type", ' independent="false" type')]
    gear = '<coupling name="gear"><predecessor link="leg"/><successor link="rotor"/><ratio value="6.0"/></coupling>'
    mechanism = cinegen.load(write(gear, f'<robot name="walker">{"".join(parts)}'))
    assert (mechanism.floating, mechanism.mobility, mechanism.actuated) == (True, 6 + 2 - 1, ("hip",))
    assert mechanism.source.dialects == ("URDF+",)
    for q in mechanism.random_closed(3, 3):
        assert q[mechanism.q_index("spin")] == pytest.approx(6.0 * q[mechanism.q_index("hip")], abs=1e-10)


def test_home_at_a_singular_drawing_is_beside_it(write):
    """Four bars that are drawn stretched out, on one line: there they could move in no direction."""
    base = BARS.replace('xyz="0 1 0"', 'xyz="1 0 0"')
    mechanism = cinegen.load(write(LOOPS["URDF+"][0].replace(ON_ROCKER, "0.5 0 0"), base))
    assert mechanism.mobility == 1
    assert mechanism.q_home.any()
    assert "all joints at 0 is singular: home is a configuration near it" in mechanism.source.notes


# --- couplings ---------------------------------------------------------------------------------------------------

ARM = f"""<robot name="arm"> {links("l0", "l1", "l2", "l3", "l4")}
  {joint_at("a", "l0", "l1", inside="{0}")}
  {joint_at("b", "l1", "l2", "1 0 0", "{1}")}
  {joint_at("f", "l2", "l3", "1 0 0", kind="fixed")}
  {joint_at("c", "l3", "l4", inside="{2}" + limit(-1, 1), kind="prismatic")}
"""

COUPLINGS = {
    "mimic": ("", '<mimic joint="a" multiplier="-2" offset="0.5"/>', "", "", {"b": -2.0}, {"b": 0.5}),
    "mimic of a mimic": (
        "", '<mimic joint="c" multiplier="3"/>', '<mimic joint="a" multiplier="0.1" offset="0.2"/>', "",
        {"b": 0.3, "c": 0.1}, {"b": 0.6, "c": 0.2},
    ),
    "mimic with defaults": ('<mimic joint="b"/>', "", "", "", {"b": 1.0}, {}),
    "Gazebo plugin": (
        "", "", "",
        '<gazebo><plugin name="m" filename="libgazebo_mimic_joint_plugin.so"><joint>a</joint><mimicJoint>b</mimicJoint>'
        "<multiplier>-1.5</multiplier><offset>0.1</offset></plugin></gazebo>",
        {"b": -1.5}, {"b": 0.1},
    ),
    "ros2_control": (
        "", "", "",
        '<ros2_control name="r" type="system"><joint name="b"><param name="mimic">a</param>'
        '<param name="multiplier">2</param></joint></ros2_control>',
        {"b": 2.0}, {},
    ),
    "URDF+": (
        "", "", "",
        '<coupling name="gear"><predecessor link="l1"/><successor link="l3"/><ratio value="4"/></coupling>',
        {"b": 0.0}, {},  # the predecessor is the nearest common ancestor: 0 = b
    ),
}  # fmt: skip


@pytest.mark.parametrize("dialect", COUPLINGS)
def test_couplings_of_each_dialect_hold(dialect, write):
    *mimics, added, slopes, offsets = COUPLINGS[dialect]
    mechanism = cinegen.load(write(added, ARM.format(*mimics)))
    assert len(mechanism.couplings) == len(slopes)
    assert mechanism.mobility == 3 - len(slopes)
    for q in [mechanism.q_home, *np.atleast_2d(mechanism.random_closed(3, 0))]:
        a = q[mechanism.q_index("a")]
        for joint, slope in slopes.items():
            position = q[mechanism.q_index(joint)]
            assert position == pytest.approx(slope * a + offsets.get(joint, 0.0), abs=1e-10)
    assert dragged(mechanism)[0] <= 1e-10


def test_a_ratio_of_urdf_plus_counts_the_joints_of_both_chains(write):
    """Two chains from the ground: 5 (a + b) = d + e."""
    joints = "".join(joint_at(f"j{child}", parent, child, "1 0 0") for parent, child in ("oa", "ab", "od", "de"))
    coupling = '<coupling name="gear"><predecessor link="b"/><successor link="e"/><ratio value="5"/></coupling>'
    mechanism = cinegen.load(write(coupling, f'<robot name="r">{links(*"oabde")}{joints}'))
    assert mechanism.mobility == 3
    assert {name: c for name, (c,) in mechanism.couplings[0].terms.items()} == {"ja": 5, "jb": 5, "jd": -1, "je": -1}


def test_a_joint_that_mimics_a_fixed_one_is_refused(write):
    path = write("", ARM.format("", '<mimic joint="f"/>', ""))
    with pytest.raises(CinegenError, match=r"couples joint 'f', which is fixed: correct it, or .* --ignore mimic"):
        cinegen.load(path)
    with pytest.warns(RaffWarning, match=r"left out, as requested: <mimic> in joint 'b' \(line 3\)"):
        assert cinegen.load(path, ignore=["mimic"]).mobility == 3


# --- links with two parents --------------------------------------------------------------------------------------


def test_of_two_joints_the_one_without_limits_is_cut(write):
    limited = joint_at("pin", "crank", "rocker", "2.5 0 0", limit(-1, 1), "revolute")
    mechanism = cinegen.load(write(limited))
    assert mechanism.joints == ("drive", "elbow", "pin")
    assert [loop.name for loop in mechanism.loops] == ["swing"]
    both = BARS.replace('name="swing" type="continuous">', f'name="swing" type="revolute">{limit(-1, 1)}')
    mechanism = cinegen.load(write(limited, both))
    assert [loop.name for loop in mechanism.loops] == ["pin"]
    (note,) = mechanism.source.notes
    assert note == "joint 'pin' closes a loop: its child 'rocker' has another parent; its limits are not enforced"


def test_a_ring_of_joints_without_a_root(write):
    """ros/urdf#13: each link has one parent, and the first link is the base."""
    corners, parts = [(0, 0), (2, 0), (3, 2), (0, 1)], [links("l0", "l1", "l2", "l3")]
    for i in range(4):
        (x, y), (u, v) = corners[i], corners[(i + 1) % 4]
        parts.append(joint_at(f"j{i}", f"l{i}", f"l{(i + 1) % 4}", f"{u - x} {v - y} 0"))
    mechanism = cinegen.load(write("", f'<robot name="ring">{"".join(parts)}'))
    assert mechanism.nodes[0] == "l0"
    assert [loop.name for loop in mechanism.loops] == ["j3"]
    assert mechanism.mobility == 1
    assert dragged(mechanism)[0] <= 1e-10


# --- loop_closures.yaml ------------------------------------------------------------------------------------------

CLOSURES = """# of scikit-robot
closures:
- {link_a: coupler, link_b: rocker, point: [2.0, 1.0, 0.0], axis: [0.0, 0.0, 1.0]}
dependent: [elbow, swing]
independent: [drive]
"""


@pytest.mark.parametrize("folder", [".", "../config"])
def test_loop_closures_of_jsk(folder, tmp_path):
    (tmp_path / "urdf").mkdir()
    (tmp_path / "config").mkdir()
    path = tmp_path / "urdf" / "bars.urdf"
    approximate = BARS.replace('"coupler"/><origin', '"coupler"/><mimic joint="drive" multiplier="-1.3"/><origin')
    path.write_text(f"{approximate}</robot>")
    (path.parent / folder / "loop_closures.yaml").write_text(CLOSURES)
    mechanism = cinegen.load(path)
    assert (mechanism.mobility, mechanism.actuated) == (1, ("drive",))
    assert [loop.kind.name for loop in mechanism.loops] == ["REVOLUTE"]
    assert mechanism.couplings == ()  # the <mimic> is an approximation
    assert mechanism.source.dialects == ("loop_closures.yaml",)
    assert mechanism.source.notes == ("<mimic> in joint 'elbow' (line 4): replaced by loop_closures.yaml",)
    assert dragged(mechanism)[0] <= 1e-10


@pytest.mark.parametrize("kind", ["continuous", "fixed"])
def test_loop_closures_of_robonex(kind, write, tmp_path):
    (tmp_path / "loop_closures.yaml").write_text(
        "pin_loops:\n  - name: pin\n    parent: coupler\n    child: rocker\n    parent_xyz: [2.0, 0.0, 0.0]\n"
        "    child_xyz: [-0.5, 1.0, 0.0]\n    axis: [0.0, 0.0, 1.0]\nball_upgrades: [elbow]\nactuated_joints: [drive]\n"
    )
    mechanism = cinegen.load(write("", BARS.replace('"elbow" type="continuous"', f'"elbow" type="{kind}"')))
    assert mechanism.joints == ("drive", "elbow_X", "elbow_Y", "elbow_Z", "swing")
    assert mechanism.actuated == ("drive",)
    assert mechanism.mobility == 1  # five joints; the hinge takes x, y, z (by tilting) and both tilts
    assert dragged(mechanism)[0] <= 1e-10


# --- several dialects at once ------------------------------------------------------------------------------------


@pytest.mark.parametrize("dialect", LOOPS)
def test_a_loop_that_two_dialects_declare_is_closed_once(dialect, write):
    other = "Gazebo joint" if LOOPS[dialect][3] == "ball" else "Isaac Sim"
    mechanism = cinegen.load(write(LOOPS[dialect][0] + LOOPS[other][0]))
    assert len(mechanism.loops) == 1
    assert mechanism.mobility == 1
    kinds = {LOOPS[dialect][3], LOOPS[other][3]}
    assert mechanism.loops[0].kind.name.lower() == ("revolute" if "revolute" in kinds else "ball")


def test_dialects_that_contradict_each_other_are_an_error(write):
    moved = LOOPS["URDF+"][0].replace(ON_COUPLER, "1.5 0 0")
    path = write(f"{LOOPS['Isaac Sim'][0]}\n{moved}")
    says = r":7: <loop> 'pin' contradicts <loop_joint> 'pin' \(line 6\) of loop_joint elements: .*--ignore loop"
    with pytest.raises(CinegenError, match=says):
        cinegen.load(path)
    with pytest.warns(RaffWarning, match=r"left out, as requested: <loop> 'pin' \(line 7\)"):
        assert cinegen.load(path, ignore=["loop"]).mobility == 1


# --- --ignore ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dialect", [*LOOPS, *COUPLINGS])
def test_all_are_opened_by_ignore_loops_and_each_loop_by_its_dialect_or_its_name(dialect, write):
    is_loop = dialect in LOOPS
    path = write(LOOPS[dialect][0]) if is_loop else write(COUPLINGS[dialect][3], ARM.format(*COUPLINGS[dialect][:3]))
    with pytest.warns(RaffWarning, match="left out, as requested; every joint moves independently: ") as seen:
        mechanism = cinegen.load(path, ignore_loops=True)
    assert len(seen) == 1
    assert mechanism.mobility == len(mechanism.actuated) == 3
    for word in set(LOOPS.get(dialect, ())[1:3]) - {"coupler-rocker"}:
        with pytest.warns(RaffWarning, match="left out, as requested: "):
            assert cinegen.load(path, ignore=[word]).mobility == 3


@pytest.mark.parametrize("kind", ["ball", "revolute"])
def test_a_triangle_is_rigid_whether_a_ball_joint_or_a_hinge_closes_it(kind):
    parts = [links("ground", "a", "b"), joint_at("to_a", "ground", "a"), joint_at("to_b", "ground", "b", "0.3 0 0")]
    parts += [FRAME.format("closing_pin_1", "a", "0.1 0.2 0"), FRAME.format("closing_pin_2", "b", "-0.2 0.2 0")]
    with pytest.warns(UserWarning, match="no joint can move"):
        triangle = cinegen.load(robot(*parts), loops={"closing_pin": kind})
    assert [loop.kind.name.lower() for loop in triangle.loops] == [kind]
    assert triangle.mobility == 0


# --- numbers that a constraints file states ----------------------------------------------------------------------


@pytest.mark.parametrize(("key", "right"), [("mobility", 2), ("loop_rows", 6)])
def test_what_the_constraints_state_is_compared_with_what_is_computed(key, right, root, tmp_path):
    raff2urdf.convert(root / "robots" / "five_bar.raff", tmp_path)
    path, urdf = tmp_path / "five_bar.constraints.json", tmp_path / "five_bar.urdf"
    assert json.loads(path.read_text())[key] == right
    assert cinegen.load(urdf).mobility == 2
    path.write_text(path.read_text().replace(f'"{key}": {right}', f'"{key}": 5'))
    line = next(i for i, line in enumerate(path.read_text().splitlines(), 1) if key in line)
    says = rf"five_bar\.constraints\.json:{line}: at \$\.{key}: 5 is stated, but the URDF with these loops has {right}"
    with pytest.raises(cinegen.CinegenError, match=says):
        cinegen.load(urdf)
    assert cinegen.load(urdf, loops={"link5-tool": "ball"}).mobility == 3  # nothing is stated of this one


def test_constraints_without_the_loops_that_the_urdf_tells_of_are_refused(root, tmp_path):
    raff2urdf.convert(root / "robots" / "five_bar.raff", tmp_path)
    path = tmp_path / "five_bar.constraints.json"
    opened = {"loops": [], "mobility": 5, "loop_rows": 0, "loop_rank": 0}
    path.write_text(json.dumps(json.loads(path.read_text()) | opened))
    with pytest.raises(CinegenError, match=r"according to this comment, the loops are in five_bar\.constraints"):
        cinegen.load(tmp_path / "five_bar.urdf")


# --- all loops open, in every format -----------------------------------------------------------------------------


@pytest.mark.parametrize("format", ["raff", "urdf", "sdf", "mjcf"])
def test_loops_are_opened_in_every_format_all_or_by_name(format, root, tmp_path):
    path = root / "robots" / "five_bar.raff"
    if format != "raff":
        path = raff2urdf.convert(path, tmp_path, format=format)[0].file
    assert cinegen.load(path).mobility == 2
    with pytest.warns(UserWarning, match="left out, .* every joint moves independently: .*loop 'link5-tool") as seen:
        mechanism = cinegen.load(path, ignore_loops=True)
    assert len(seen) == 1
    assert (mechanism.mobility, len(mechanism.loops), len(mechanism.joints)) == (5, 0, 5)
    assert mechanism.actuated == mechanism.joints
    name = cinegen.load(path).loops[0].name
    with pytest.warns(UserWarning, match=f"left out, as requested: .*'{name}'"):
        mechanism = cinegen.load(path, ignore=[name])
    assert (len(mechanism.loops), mechanism.mobility) == (0, 5)


# --- scenes ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [{"ignore_loops": True}, {"ignore": ["closure"]}])
def test_the_robot_of_a_scene_is_opened_on_demand(options, write, text_file):
    write(LOOPS["URDF+"][0].replace("<loop ", "<closure ").replace("</loop>", "</closure>"))
    scene = 'robot = "bars.urdf"\nnode = "coupler"\nsafety = 0.01\ngoal = { point = [1.5, 0, 0] }\n'
    path = text_file("scene.toml", scene)
    with pytest.raises(CinegenError, match=r"bars.urdf:6: <closure> 'pin' \('coupler', 'rocker'\) declares a loop"):
        load_scene(path)
    with pytest.warns(RaffWarning, match=r"bars.urdf: left out, as requested.*: <closure> 'pin' \(line 6\)"):
        assert load_scene(path, **options).mechanism.mobility == 3
