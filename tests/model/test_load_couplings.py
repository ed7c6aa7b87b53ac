"""Couplings of SDF and MJCF, compared with what the formats define: rotations of links, and MuJoCo's own residuals."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_like_names import names

import cinegen
from raff2urdf.readers import mjcf

# --- SDF ---------------------------------------------------------------------------------------------------------

TRAIN = """<sdf version="1.11">
  <model name="train">
    <link name="ground"/>
    <link name="carrier"/>
    <link name="input"><pose>0 0.3 0 0.2 0.3 0.4</pose></link>
    <link name="output"><pose>0.1 0 0.5 0.7 0 1</pose></link>
    <joint name="fix" type="fixed"><parent>world</parent><child>ground</child></joint>
    <joint name="arm" type="revolute"><parent>ground</parent><child>carrier</child>
      <axis><xyz expressed_in="__model__">0 0 1</xyz></axis></joint>
    <joint name="in" type="revolute">{in_ends}<axis><xyz expressed_in="__model__">{in_axis}</xyz></axis></joint>
    <joint name="out" type="revolute"><parent>{carrier}</parent><child>output</child>
      <axis><xyz expressed_in="__model__">0 0 -1</xyz>{more}</axis></joint>
    {gear}
  </model>
</sdf>"""

GEAR = """<joint name="gear" type="gearbox"><parent>input</parent><child>output</child>
      <gearbox_ratio>2.5</gearbox_ratio><gearbox_reference_body>{reference}</gearbox_reference_body>
      <axis><xyz expressed_in="__model__">{axis}</xyz></axis>
      <axis2><xyz expressed_in="__model__">0 0 1</xyz></axis2></joint>"""


def train(reference="ground", carrier="ground", in_axis="1 0 0", axis=None, reverse=False, gear=GEAR, more=""):
    ends = ("<child>ground</child>", "<parent>input</parent>")
    ends = ends if reverse else ("<child>input</child>", "<parent>ground</parent>")
    return TRAIN.format(
        in_ends="".join(ends), in_axis=in_axis, carrier=carrier, more=more,
        gear=gear.format(reference=reference, axis=axis or in_axis),
    )  # fmt: skip


def angle(mechanism, q, reference, link, axis):
    """The angle by which a link is rotated about an axis of the model, as seen from another link, since all are 0."""
    zero = mechanism.configuration(dict.fromkeys(mechanism.joints, 0.0))

    def seen(at):
        return mechanism.placement(at, reference).rotation.T @ mechanism.placement(at, link).rotation

    rotation = pin.log3(seen(q) @ seen(zero).T)
    axis = mechanism.placement(zero, reference).rotation.T @ np.array(axis, dtype=float)
    assert np.abs(np.cross(rotation, axis)).max() < 1e-9
    return rotation @ axis


def sample(mechanism, count=6, size=0.4):
    """Closed configurations near home: angles are below pi."""
    rng = np.random.default_rng(3)
    for _ in range(count):
        q = mechanism.q_home + size * rng.uniform(-1.0, 1.0, mechanism.model.nq)
        yield mechanism.close(q)


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("axis", ["1 0 0", "-1 0 0"])
def test_a_gearbox_rotates_its_child_by_minus_its_ratio(reverse, axis):
    mechanism = cinegen.load(train(axis=axis, reverse=reverse))
    assert mechanism.mobility == 2
    first = [float(x) for x in axis.split()]
    moved = 0.0
    for q in sample(mechanism):
        driving = angle(mechanism, q, "ground", "input", first)
        assert angle(mechanism, q, "ground", "output", (0, 0, 1)) == pytest.approx(-2.5 * driving, abs=1e-10)
        moved = max(moved, abs(driving))
    assert moved > 0.05


def test_a_planetary_gearbox_counts_from_its_carrier():
    mechanism = cinegen.load(train(reference="carrier", carrier="carrier", in_axis="0 0 1"))
    assert mechanism.mobility == 2
    (coupling,) = mechanism.couplings
    assert {name: c for name, (c,) in coupling.terms.items()} == {"out": -1.0, "in": 2.5, "arm": -2.5}
    for q in sample(mechanism):
        driving = angle(mechanism, q, "carrier", "input", (0, 0, 1))
        assert angle(mechanism, q, "carrier", "output", (0, 0, 1)) == pytest.approx(-2.5 * driving, abs=1e-10)


def test_an_axis_that_mimics_follows_its_leader():
    mimic = '<mimic joint="in"><multiplier>-3</multiplier><offset>0.2</offset><reference>0.1</reference></mimic>'
    mechanism = cinegen.load(train(gear="", more=mimic))
    assert mechanism.mobility == 2
    (coupling,) = mechanism.couplings
    assert coupling.name == "out-in"
    for q in sample(mechanism):
        leader, follower = (q[mechanism.q_index(joint)] for joint in ("in", "out"))
        assert follower == pytest.approx(-3.0 * (leader - 0.1) + 0.2, abs=1e-10)


LINKAGE = """<sdf version="1.11">
  <model name="linkage">
    <link name="ground"/>
    <link name="rod"><pose>1 0 0 0 0 0</pose></link>
    <link name="slider"><pose>1 0.2 0 0 0 0</pose></link>
    <joint name="fix" type="fixed"><parent>world</parent><child>ground</child></joint>
    <joint name="drive" type="{drive}"><parent>ground</parent><child>rod</child>
      <axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 1 0</xyz></axis2></joint>
    <joint name="slide" type="{slide}"><parent>ground</parent><child>slider</child>
      <axis><xyz>1 0 0</xyz><limit><lower>-1</lower><upper>1</upper></limit>{mimic}</axis>
      <axis2><xyz>0 0 1</xyz></axis2></joint>
    {more}
  </model>
</sdf>"""


def linkage(drive, slide="prismatic", mimic="", more=""):
    return LINKAGE.format(drive=drive, slide=slide, mimic=mimic, more=more)


@pytest.mark.parametrize(("pitch", "travel", "reverse"), [
    ("<screw_thread_pitch>0.02</screw_thread_pitch>", 0.02, False),
    ("<thread_pitch>-314.1592653589793</thread_pitch>", 0.02, True),
    ("<thread_pitch>314.1592653589793</thread_pitch><screw_thread_pitch>-0.03</screw_thread_pitch>", -0.03, False),
    ("", 1.0, False),
], ids=["screw_thread_pitch", "thread_pitch", "both", "default"])  # fmt: skip
def test_a_screw_advances_by_its_pitch(pitch, travel, reverse):
    text = linkage("screw").replace("</child>\n      <axis>", f"</child>{pitch}<axis>", 1)
    if reverse:
        text = text.replace("<parent>ground</parent><child>rod</child>", "<parent>rod</parent><child>ground</child>")
    mechanism = cinegen.load(text)
    assert ({*mechanism.joints}, mechanism.mobility) == ({"drive", "drive_T", "slide"}, 2)
    for q in sample(mechanism):
        turned = angle(mechanism, q, "ground", "rod", (1, 0, 0))
        moved = mechanism.placement(q, "rod").translation - [1.0, 0.0, 0.0]
        revolutions = (moved[0] / travel) - turned / (2.0 * np.pi)
        assert revolutions == pytest.approx(round(revolutions), abs=1e-8)
        assert moved[1:] == pytest.approx([0.0, 0.0], abs=1e-10)


CUT = """<joint name="cut" type="{}"><pose>0.3 0.5 0.2 0 0 0</pose><parent>slider</parent><child>rod</child>
  <axis><xyz>0 0.6 0.8</xyz></axis><axis2><xyz>1 0 0</xyz></axis2></joint>"""


@pytest.mark.parametrize(("slide", "kind", "mobility"), [
    # degrees of freedom of a ball joint and a slide, less those that the third joint removes
    ("prismatic", "ball", 3 + 1 - 3),
    ("universal", "universal", 3 + 2 - 4),
    ("ball", "revolute", 3 + 3 - 5),
    ("ball", "screw", 3 + 3 - 5),
    ("ball", "prismatic", 3 + 3 - 5),
    ("universal", "fixed", 0),
])  # fmt: skip
def test_a_joint_of_any_kind_closes_a_loop(slide, kind, mobility):
    mechanism = cinegen.load(linkage("ball", slide, more=CUT.format(kind)))
    assert [loop.name for loop in mechanism.loops] == ["cut"]
    assert mechanism.gap_as_written < 1e-15
    assert mechanism.mobility == mobility
    assert {mechanism.loops[0].first, mechanism.loops[0].second} <= {*mechanism.nodes}
    if kind == "universal":
        for q in sample(mechanism):
            first = mechanism.placement(q, "slider").rotation @ [0.0, 0.6, 0.8]
            assert first @ mechanism.placement(q, "rod").rotation[:, 0] == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize(("text", "says"), [
    (train(in_axis="1 0 0", axis="0 1 0"), r":13: gearbox 'gear': .* 'in' rotates about another axis"),
    (train().replace("<axis2>", "<axis3>").replace("</axis2>", "</axis3>"), "joint 'gear' has 1 of 2 axes"),
    (train(gear="", more='<mimic joint="inn"/>'), "joint 'out' mimics 'inn', which has no such axis: did you mean"),
    (train(gear="", more='<mimic joint="in" axis="axis2"/>'), "joint 'out' mimics 'in', which has no such axis"),
    (linkage("screw").replace("</child>\n      <axis>", "</child><thread_pitch>0</thread_pitch><axis>", 1),
     "the thread_pitch of joint 'drive' must be a number other than 0"),
])  # fmt: skip
def test_a_coupling_that_has_no_meaning_is_an_error_with_its_line(text, says):
    with pytest.raises(cinegen.CinegenError, match=says):
        cinegen.load(text)


ENDS = "<parent>input</parent><child>output</child>"


@settings(max_examples=150)
@given(names(), st.integers(0, 6), st.sampled_from(["", "gz:", "my:"]))
def test_no_element_that_sounds_like_a_loop_is_dropped_in_silence(tmp_path_factory, name, form, prefix):
    """It is refused at its line, unless it is left out by name."""
    element = f'<{prefix}{name} name="e">{ENDS}</{prefix}{name}>'
    text = train(gear="")
    if form == 0:  # in a world, behind the model
        text = text.replace("<model name", "<world name='w'><model name")
        text = text.replace("</model>", f"</model>{element}</world>")
    else:
        before, added = [
            ("</model>", element),
            ("</model>", f"<my_extension>{element}</my_extension>"),
            ("</model>", f'<plugin name="p" filename="f">{element}</plugin>'),
            ("</axis>", element),
            ("</joint>", element),
            ("</link>", element),
        ][form - 1]
        text = text.replace('<link name="ground"/>', '<link name="ground"></link>')
        text = text.replace(before, added + before, 1)
    if f"{prefix}{name}" == "mimic" and form == 4:
        return  # SDF's own, which names no joint
    path = tmp_path_factory.mktemp("fuzz") / "train.sdf"
    path.write_text(text)
    with pytest.raises(cinegen.CinegenError, match=rf":\d+: <{prefix}{name}> 'e' seems to declare .*--ignore e "):
        cinegen.load(path)
    with pytest.warns(UserWarning, match="left out, as requested: 'e'"):
        assert cinegen.load(path, ignore=["e"]).mobility == 3


@pytest.mark.parametrize("kind", ["ball", "revolute"])
def test_frames_that_coincide_close_a_loop(kind):
    frame = '<frame name="closing_pin_{}" attached_to="{}"><pose relative_to="input">0.1 0 {} 0 0 0</pose></frame>'
    frames = frame.format(1, "input", 0) + frame.format(2, "output", 0)
    if kind == "revolute":
        frames += frame.format("1_z", "input", 0.1) + frame.format("2_z", "output", 0.1)
    mechanism = cinegen.load(train(gear=frames))
    assert [(loop.name, loop.kind.name.lower()) for loop in mechanism.loops] == [("closing_pin", kind)]
    assert mechanism.mobility == 1
    assert cinegen.load(train(gear=frames), ignore=["closing_pin"]).mobility == 3
    joint = f'<joint name="pin" type="ball">{ENDS}</joint>'
    assert [loop.name for loop in cinegen.load(train(gear=frames + joint)).loops] == ["pin"]


# --- MJCF --------------------------------------------------------------------------------------------------------

ROW = """<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="a"><joint name="x" axis="0 0 1" ref="0.3"/><geom size="0.1"/>
      <body name="b" pos="1 0 0"><joint name="y" axis="0 1 0" ref="-0.2"/><geom size="0.1"/>
        <body name="c" pos="0 1 0"><joint name="z" type="slide" axis="1 2 0" ref="0.5"/><geom size="0.1"/>
          <body name="d" pos="0 0 1"><joint name="ball" type="ball"/><geom size="0.1"/><site name="t"/></body></body>
      </body></body>
    <body name="e" pos="2 0 0"><joint name="w" axis="1 0 0"/><geom size="0.1"/><site name="s" pos="0 0.1 0.2"/></body>
  </worldbody>
  <tendon>
    <fixed name="sum"><joint joint="x" coef="0.5"/><joint joint="y" coef="-2"/></fixed>
    <fixed name="one"><joint joint="w" coef="3"/></fixed>
    <fixed name="two" limited="true" range="-1 1"><joint joint="z" coef="1"/><joint joint="w" coef="1"/></fixed>
    <spatial name="rope"><site site="s"/><site site="t"/></spatial>
  </tendon>
  <equality>{}</equality>
</mujoco>"""

CURVE = 'polycoef="0.1 -0.7 0.2 0.3 -0.1"'
EQUALITIES = {
    "a ratio": '<joint name="e" joint1="y" joint2="x" polycoef="0 -2 0 0 0"/>',
    "a curve": f'<joint name="e" joint1="z" joint2="x" {CURVE}/>',
    "a tendon at a constant": '<tendon name="e" tendon1="sum" polycoef="0.2 0 0 0 0"/>',
    "a curve of tendons": f'<tendon name="e" tendon1="two" tendon2="one" {CURVE}/>',
    "several": f'<joint name="e" joint1="z" joint2="x" {CURVE}/><tendon name="f" tendon1="sum" tendon2="one"/>'
    '<joint name="g" joint1="w" joint2="y" polycoef="0 0.5 0.2 0 0" active="false"/>',
    "a weld of points": '<weld name="e" body1="d" body2="e" torquescale="0"/><joint name="f" joint1="z" joint2="x"/>',
}


@pytest.mark.parametrize("name", EQUALITIES)
def test_couplings_are_mujocos(name):
    text = ROW.format(EQUALITIES[name])
    mechanism = cinegen.load(text)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    ranks = []
    for q in [mechanism.q_home, *mechanism.random_closed(5)]:
        at = mechanism.values(q)
        x, y, z, w = at["ball"]
        data.qpos[:] = [at["x"], at["y"], at["z"], w, x, y, z, at["w"]]
        mujoco.mj_forward(model, data)
        rows = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        assert rows.sum() >= len(mechanism.couplings) > 0
        assert np.abs(data.efc_pos[: data.nefc][rows]).max() < 1e-11
        ranks.append(np.linalg.matrix_rank(data.efc_J.reshape(-1, model.nv)[: data.nefc][rows], tol=1e-8))
    assert mechanism.mobility == model.nv - max(ranks)


def test_what_is_not_read_of_an_mjcf_is_listed(text_file):
    path = text_file("row.xml", ROW.format(EQUALITIES["several"]))
    assert mjcf.read(path).ignored == ["equality constraint 'g' (not active)", "limits of tendon 'two'"]
    notes = cinegen.load(path).source.notes
    assert notes == ("not read: equality constraint 'g' (not active)", "not read: limits of tendon 'two'")
    loaded = mjcf.read(path, ignore=["e"])
    assert [coupling["name"] for coupling in loaded.constraints["couplings"]] == ["f"]
    assert loaded.ignored[0] == "equality constraint 'e'"


@pytest.mark.parametrize(("equality", "says"), [
    ('<tendon name="e" tendon1="rope"/>', "'e' constrains the spatial tendon 'rope', whose length is no sum"),
    (f'<tendon name="e" tendon1="one" tendon2="sum" {CURVE}/>', "'e' is a curve of a tendon with 2 joints"),
    ('<joint name="e" joint1="ball"/>', r"row.xml:\d+: MuJoCo can't read it: .*(?:'e'|ball)"),
])  # fmt: skip
def test_an_equality_without_counterpart_is_an_error_that_names_it(text_file, equality, says):
    path = text_file("row.xml", ROW.format(equality))
    with pytest.raises(cinegen.CinegenError, match=says) as failed:
        cinegen.load(path)
    if "MuJoCo" not in str(failed.value):
        assert "--ignore e " in str(failed.value)
        assert mjcf.read(path, ignore=["e"]).ignored[0] == "equality constraint 'e'"


def test_a_flex_is_left_out_with_its_constraints_only_on_request(text_file):
    grid = """<flexcomp name="cloth" type="grid" count="3 3 1" spacing="0.1 0.1 0.1" radius="0.01" mass="1">
      <edge equality="true"/></flexcomp><body><joint name="j"/><geom size="0.1"/></body>"""
    path = text_file("row.xml", f"<mujoco><worldbody>{grid}</worldbody></mujoco>")
    says = r"constrains the flex 'cloth', and only rigid bodies .*--ignore cloth"
    with pytest.raises(cinegen.CinegenError, match=says):
        cinegen.load(path)
    assert mjcf.read(path, ignore=["cloth"]).ignored == ["equality constraint 'cloth'"]
