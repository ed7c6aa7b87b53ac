"""Read SDF, Gazebo's Simulation Description Format, as a URDF and the loops that it closes.

SDF gives every link a pose in the model, at the configuration where all joint variables are 0, and joints between
any two links: a joint between links that the tree contains already closes a loop. Versions 1.4 to 1.12 are read: links,
their visuals, joints, frames, nested models; not what is for simulators only (collisions, sensors, plugins).
The elements that raff2urdf adds (`raff:robot`: zeros of joints, actuated joints, ends of loops) are read too.
"""

from __future__ import annotations

from lxml import etree

from raff2urdf.constraints import Constraints
from raff2urdf.errors import did_you_mean
from raff2urdf.readers.sdf.conversion import SdfToUrdf
from raff2urdf.readers.sdf.model import Reader
from raff2urdf.readers.urdf import numbers
from raff2urdf.readers.xml_file import error_at, parse_xml


def read(text: str, name: str, robot: str | None = None) -> tuple[str, Constraints]:
    """Return a URDF and its constraints, from the text of an SDF.

    Args:
        text: of the file.
        name: of the file, in errors.
        robot: which model; the first by default.

    Raises:
        RaffError: not an SDF, no such model, or something in it that has no counterpart; with the element's line.
    """
    root = parse_xml(text, name)
    etree.strip_tags(root, etree.Comment)
    models = [m for m in root.iter("model") if m.getparent().tag in ("sdf", "world", "population")]
    chosen = [m for m in models if robot is None or m.get("name") == robot]
    if not chosen:
        known = [str(m.get("name")) for m in models]
        what = "the file has no model" if robot is None else f"there is no model '{robot}'{did_you_mean(robot, known)}"
        for include in root.iter("include"):
            what += f", but the file includes '{include.findtext('uri', '').strip()}': load that file itself"
            break
        raise error_at(name, root, what)
    version = numbers(root.get("version", "1.6").replace(".", " ")) or [1.0, 6.0]
    model = Reader(name, (int(version[0]), int(version[-1]) if len(version) > 1 else 0)).model(chosen[0])
    return SdfToUrdf(name, model).run()
