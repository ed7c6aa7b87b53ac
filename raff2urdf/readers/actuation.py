"""Joints that must be actuated, and how a file of each format declares them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from raff2urdf.errors import first_of
from raff2urdf.readers import holds_xml
from raff2urdf.readers.loops import robot_yaml, sidecar
from raff2urdf.readers.xml_file import own_element, parse_xml, read_text

RAFF = "'actuated 1' in its link"
_MOST = 8  # names that are listed
_CONSTRAINTS = '"actuated": true in '
_SDF = '<raff:joint name="NAME" actuated="true"/> in the model\'s <raff:robot xmlns:raff="urn:raff2urdf">'


def syntax_of(path: Path) -> str:
    """Return how a robot's file, or the file next to it, declares that a joint is actuated.

    Args:
        path: of the RAFF file, URDF, xacro, SDF or MJCF. Of what is no file, the option of a program is returned.
    """
    if not path.is_file():
        return "load(..., actuated=[...])"
    if not holds_xml(path):
        return RAFF
    root = parse_xml(read_text(path), str(path))
    if root.tag == "mujoco":
        return '<general joint="NAME"/> in <actuator>'
    if root.tag == "sdf":
        return _SDF
    constraints = sidecar.constraints_of(path)
    if constraints.is_file() or own_element(root, str(path)) is not None:
        return _CONSTRAINTS + (constraints.name if constraints.is_file() else "raff:robot")
    yaml = robot_yaml.sidecar_of(path) or sidecar.plain(path).with_suffix(".yaml")
    return f"its name in name_mot: [...] of {yaml.name}"


def replaced(uncontrolled: Sequence[str], dependent: Sequence[str]) -> str:
    """Return the text about joints that a file names as driven and that do not determine a mechanism: what is actuated
    instead; the arguments are those of `advice`."""
    parts = [f"{_listed(uncontrolled)} actuated, too"] if uncontrolled else []
    parts += [f"{_listed(dependent)} passive"] if dependent else []
    why = "depend on each other" if dependent else "do not determine its motion"
    return (
        f"the joints that its transmissions, command interfaces or plugins name {why}: {', and '.join(parts)}; "
        "--actuated JOINTS (in Python actuated=[...]) names others"
    )


def _listed(names: Sequence[str]) -> str:
    return f"{first_of(names, _MOST)} {'is' if len(names) == 1 else 'are'}"


def advice(uncontrolled: Sequence[str], dependent: Sequence[str], syntax: str, dof: int) -> str:
    """Return the text about actuated joints that don't determine a mechanism, and about those that would.

    Args:
        uncontrolled: passive joints that neither loops nor actuated joints determine.
        dependent: actuated joints that the loops and the others determine.
        syntax: see `syntax_of`.
        dof: degrees of freedom that the actuated joints leave: of these passive joints and of ball joints.
    """
    of_balls = f", {dof - len(uncontrolled)} of them of ball joints" if dof > len(uncontrolled) else ""
    instead = f"instead of {', '.join(dependent)}" if dependent else "too"
    return (
        f"with its actuated joints locked it still moves, with {dof} DoF{of_balls}: let "
        f"{', '.join(uncontrolled)} be actuated {instead}; {syntax} declares that"
    )
