"""A robot with two arms of seven joints on one torso, whose hands are in front of it."""

from urdf_text import UrdfJoint, urdf_text

AXES = ("0 0 1", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
OFFSETS = ("0 0 0", "0.05 0 0", "0.1 0 0", "0.25 0 0", "0.1 0 0", "0.2 0 0", "0.05 0 0")


def _urdf() -> str:
    joints = [UrdfJoint("to_waist", "torso", "waist", "0 0 0.6", limit=(-2.5, 2.5), velocity=3.0)]
    for side, y, bend in (("left", 0.2, 0.1), ("right", -0.2, -0.1)):
        parent = "waist"
        for i, (axis, offset) in enumerate(zip(AXES, OFFSETS, strict=True)):
            origin, rpy = (f"0 {y} 0.3", f"0 0.3 {-bend}") if i == 0 else (offset, "0 -0.6 0" if i == 3 else "0 0 0")
            link = f"{side}{i + 1}"
            joints.append(UrdfJoint(f"to_{link}", parent, link, origin, axis, "revolute", (-2.5, 2.5), 1.0, 3.0, rpy))
            parent = link
        joints.append(UrdfJoint(f"to_{side}_hand", parent, f"{side}_hand", "0.08 0 0", kind="fixed"))
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    box = '<visual><geometry><box size="{0} {0} {0}"/></geometry></visual>'
    links = ["torso", *(joint.child for joint in joints)]
    bodies = {link: mass + box.format(0.12 if "hand" in link else 0.05) for link in links}
    return urdf_text(joints, bodies, "two_armed")


URDF = _urdf()
