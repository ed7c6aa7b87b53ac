"""Elements of URDFs, as text."""


def links(*names: str) -> str:
    """Links without masses and shapes."""
    return "".join(f'<link name="{name}"/>' for name in names)


def joint_text(name: str, parent: str, child: str, inside: str = "", kind: str = "continuous") -> str:
    """A joint, which has more elements inside."""
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


def joint_at(name: str, parent: str, child: str, xyz: str = "0 0 0", inside: str = "", kind: str = "continuous") -> str:
    """A joint at a place of its parent, along or about z."""
    return joint_text(name, parent, child, f'<origin xyz="{xyz}"/><axis xyz="0 0 1"/>{inside}', kind)


def limit(lower: float, upper: float) -> str:
    """Limits of a joint; those of velocity and effort are 1."""
    return f'<limit lower="{lower}" upper="{upper}" velocity="1" effort="1"/>'


def robot(*parts: str, name: str = "r") -> str:
    """A URDF of these elements."""
    return "\n".join([f'<robot name="{name}">', *parts, "</robot>"])


BARS = f"""<robot name="bars">
  {links("ground", "crank", "coupler", "rocker")}
  {joint_at("drive", "ground", "crank")}
  {joint_at("elbow", "crank", "coupler", "0 1 0")}
  {joint_at("swing", "ground", "rocker", "2.5 0 0")}
"""
"""Bars that are no closed four-bar yet; what is added begins on line 6."""
