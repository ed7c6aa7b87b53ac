"""SDF, Gazebo's Simulation Description Format, as a URDF and the loops that it closes.

SDF gives every link a pose in the model, at the configuration where all joint variables are 0, and joints between
any two links: one that joins links which stand already closes a loop, and becomes one. Read are versions 1.4 to 1.12:
links, their visuals, joints, frames, models within models; not what simulators add (collisions, sensors, plugins).
What raff2urdf adds (`raff:robot`: zeros of joints, motors, loops' ends) is read too: its robots come back as they were.
"""

from __future__ import annotations

from lxml import etree

from raff2urdf.constraints import Constraints
from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.readers.sdf.model import Reader
from raff2urdf.readers.sdf.tree import Writer
from raff2urdf.readers.urdf import numbers
from raff2urdf.readers.xml_file import parse_xml


def read(text: str, name: str, robot: str | None = None) -> tuple[str, Constraints]:
    """A URDF and what it can't say, from the text of an SDF.

    Args:
        text: of the file.
        name: what errors call it.
        robot: which model; the first unless said.

    Raises:
        RaffError: no SDF, no such model, or something in it that can't be said; with the element's line.
    """
    root = parse_xml(text, name)
    etree.strip_tags(root, etree.Comment)
    models = [m for m in root.iter("model") if m.getparent().tag in ("sdf", "world", "population")]
    chosen = [m for m in models if robot is None or m.get("name") == robot]
    if not chosen:
        known = [str(m.get("name")) for m in models]
        what = "it holds no model" if robot is None else f"no model '{robot}'{did_you_mean(robot, known)}"
        for include in root.iter("include"):
            what += f", but includes '{include.findtext('uri', '').strip()}': load that file itself"
            break
        raise RaffError(f"{name}:{root.sourceline}: {what}")
    version = numbers(root.get("version", "1.6").replace(".", " ")) or [1.0, 6.0]
    model = Reader(name, (int(version[0]), int(version[-1]) if len(version) > 1 else 0)).model(chosen[0])
    return Writer(name, model).write()
