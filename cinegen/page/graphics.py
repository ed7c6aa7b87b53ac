"""The graphic files that a RAFF text names, for a page in which the text is edited: such a page reads no files."""

from __future__ import annotations

import warnings
from collections import Counter
from pathlib import Path
from typing import Any

from meshcat import Visualizer
from meshcat.geometry import Mesh

from cinegen.cockpit.graphic_file import UNCOLOURED, draw_file
from cinegen.cockpit.page import Page
from raff2urdf.errors import RaffError, RaffWarning
from raff2urdf.graphics.meshes import Graphics
from raff2urdf.raff.reader import parse


def embedded(text: str, name: str, folder: Path) -> list[dict[str, Any]]:
    """Return the graphic files that a text names, as `static/editor/graphics.js` takes them.

    Each has its `key`, the drawing commands of its surfaces in base16, the `problem` with it (None if there is none),
    and the number of nodes that name it, `uses`. A warning lists files that can't be shown.

    Args:
        text: RAFF text. Of one with errors no files are known; a warning states it.
        name: name of the text, for warnings.
        folder: of the text; files are looked for relative to it.
    """
    try:
        document = parse(text, name)
    except RaffError:
        warnings.warn(f"{name} has errors: the page holds none of its graphics", RaffWarning, stacklevel=3)
        return []
    uses = Counter[str]()
    found = dict[str, dict[str, Any]]()
    for robot in document.robots:
        graphics = Graphics(robot, folder)
        for node in robot.nodes.values():
            named = {key_of(robot.path or "", file): file for file in node.filenames or ()}
            uses.update(named.keys())
            for key, file in named.items():
                if key not in found:
                    found[key] = _embedded(graphics, file) | {"key": key}
    missing = [f"{key} ({one['problem']})" for key, one in found.items() if one["problem"] is not None]
    if missing:
        shown = "; ".join(missing[:10]) + (f"; and {len(missing) - 10} more" if len(missing) > 10 else "")
        warnings.warn(f"{name}: graphics that can't be shown: {shown}", RaffWarning, stacklevel=3)
    return [one | {"uses": uses[key]} for key, one in found.items()]


def key_of(path: str, name: str) -> str:
    """Return a file as a text names it, by its robot's `path` and its name: one text for all spellings of one path.

    A name that begins at the root or at a home folder stands alone.
    """
    whole = name if path == "" or name.startswith(("~", "/")) else f"{path}/{name}"
    parts = [part for part in whole.split("/") if part not in ("", ".")]
    return ("/" if whole.startswith("/") else "") + "/".join(parts)


def _embedded(graphics: Graphics, file: str) -> dict[str, Any]:
    drawings, problem = graphics.of_file(file)
    page, number = Page(), 0
    for drawing in drawings:
        rgba = UNCOLOURED if drawing.colour is None else [channel / 255.0 for channel in drawing.colour]
        for geometry, look in draw_file(drawing.path, rgba, drawing.colour is None):
            Visualizer(window=page)[f"/graphics/{number}"].set_object(Mesh(geometry, look))
            number += 1
    return {"commands": [command.hex() for command in page.scene().values()], "problem": problem}
