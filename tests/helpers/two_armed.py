"""A robot with two arms of seven joints on one torso, whose hands are in front of it."""

AXES = ("0 0 1", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
OFFSETS = ("0 0 0", "0.05 0 0", "0.1 0 0", "0.25 0 0", "0.1 0 0", "0.2 0 0", "0.05 0 0")


def _urdf() -> str:
    links, joints = ["torso"], []

    def add(name: str, parent: str, origin: str, axis: str | None, rpy: str = "0 0 0") -> str:
        links.append(name)
        kind, own = ("fixed", "") if axis is None else ("revolute", f'<axis xyz="{axis}"/>')
        limit = "" if axis is None else '<limit lower="-2.5" upper="2.5" effort="1" velocity="3"/>'
        joints.append(
            f'<joint name="to_{name}" type="{kind}"><parent link="{parent}"/><child link="{name}"/>'
            f'<origin xyz="{origin}" rpy="{rpy}"/>{own}{limit}</joint>'
        )
        return name

    waist = add("waist", "torso", "0 0 0.6", "0 0 1")
    for side, y, bend in (("left", 0.2, 0.1), ("right", -0.2, -0.1)):
        parent = waist
        for i, (axis, offset) in enumerate(zip(AXES, OFFSETS, strict=True)):
            origin, rpy = (f"0 {y} 0.3", f"0 0.3 {-bend}") if i == 0 else (offset, "0 -0.6 0" if i == 3 else "0 0 0")
            parent = add(f"{side}{i + 1}", parent, origin, axis, rpy)
        add(f"{side}_hand", parent, "0.08 0 0", None)
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    box = '<visual><geometry><box size="{0} {0} {0}"/></geometry></visual>'
    bodies = "".join(
        f'<link name="{name}">{mass}{box.format(0.12 if "hand" in name else 0.05)}</link>' for name in links
    )
    return f'<robot name="two_armed">{bodies}{"".join(joints)}</robot>'


URDF = _urdf()
