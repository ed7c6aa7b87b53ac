"""Robots as simulators get them: made once for each file, and what the tests of all formats ask of them."""

import re
import warnings
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from mechanisms import KNOWN
from numpy.typing import NDArray
from small_robots import FLOATING as FLOATS
from small_robots import four_bar

from raff2urdf import loads
from raff2urdf.conversion import Translation, translate
from raff2urdf.errors import RaffWarning
from raff2urdf.raff.check import check
from raff2urdf.raff.document import Document
from raff2urdf.raff.reader import parse, read
from raff2urdf.tree import placements
from raff2urdf.writers import WriteOptions, files
from raff2urdf.writers.inertia import Inertias, inertias
from raff2urdf.writers.tree_at_home import TreeAtHome

Matrix = NDArray[np.float64]

ROBOTS = Path(__file__).resolve().parents[2] / "robots"

FLOATING = """RAFF rover
robot rover {
  base { parameters { d 200 gamma 30 epsilon 50 alpha 20 } }
  link 1 { parameters { d 200 alpha 90 theta 20 } type 2 pred 0 limits { -60 80 } velocity 90 effort 40 }
  link 2 { parameters { d 150 r 40 } type 1 pred 1 }
  frame 3 { name "gripper" parameters { d 300 } pred 2 }
  constraint { base sensor ( 0 1 ) }
}
sensor 1 { port "/dev/ttyS0" }
"""

SLIDE = KNOWN["slider-crank, cut at the slide"][0]
ELSEWHERE = re.sub("base {.*}", "base { parameters { gamma 40 epsilon 300 alpha 25 d 100 } }", SLIDE)
"""A base that stands neither at the origin nor upright, and a prismatic loop whose second end is on it."""

LOOSE = four_bar(more=FLOATS[0], after=FLOATS[1])
"""A closed robot that can move as a whole, written with rounded angles."""

CHAINS = ("slider-crank, cut at the slide", "planar 3-RRR")
TEXTS = {name: KNOWN[name][0] for name in CHAINS} | {
    "floating": FLOATING,
    "elsewhere": ELSEWHERE,
    "loose": LOOSE,
    "micrometres": "RAFF m\nunits um\n" + KNOWN["four-bar"][0].split("\n", 1)[1],
    "pin in place": "RAFF p\nrobot r { link 1 { parameters { theta 30 } type 2 pred 0 limits { 30 30 } } }\n",
}
"""Texts of robots beyond those in `robots`, by name."""

ALL = ["sr400", "gough", "scara", "differential_wrist", "two_arms.right", *TEXTS]


@dataclass(frozen=True)
class Exported:
    """A robot, and where its nodes are by RAFF itself."""

    document: Document
    made: Translation
    folder: Path

    @property
    def tree(self) -> TreeAtHome:
        return TreeAtHome(self.made)

    @property
    def inertias(self) -> Inertias:
        return inertias(self.made.model.robot, None, self.made.surface, self.tree.moving)

    def text(self, format: str, **options: Any) -> str:
        """The robot's own file."""
        return next(iter(self._files(format, options).values())).decode()

    def _files(self, format: str, options: dict[str, Any]) -> dict[str, bytes]:
        with warnings.catch_warnings():  # of couplings of three joints
            warnings.filterwarnings("ignore", "robot '.*': SDF has no notation for", RaffWarning)
            return dict(files(format, self.made, "robot", WriteOptions(**options)))

    def write(self, format: str, folder: Path, **options: Any) -> Path:
        """All files, where their meshes are found; returns the robot's own."""
        assert folder == self.folder
        contents = {folder / name: content for name, content in self._files(format, options).items()}
        for path, content in {**self.made.meshes, **contents}.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        return next(iter(contents))

    @property
    def home(self) -> dict[str, float]:
        return dict(self.made.analysis.home)

    @property
    def length(self) -> float:
        return self.made.analysis.length

    def placed(self, q: dict[str, float]) -> dict[str, Matrix]:
        """Placement in the world of every node by its name, at joint values by name."""
        by_number = placements(self.document, self.made.robot, q)
        return {part.node: by_number[number] for number, part in self.made.robot.nodes.items()}


@cache
def exported(name: str, folder: Path) -> Exported:
    """A robot of `robots`, or of `TEXTS`, for files in that folder."""
    if name in TEXTS:
        document, which = loads(TEXTS[name]), None
    else:
        stem, _, second = name.partition(".")
        path = ROBOTS / f"{stem}.raff"
        document, which = parse(read(path), str(path)), second or None
    check(document)
    made = translate(document, document.robot(which), ROBOTS, folder, meshes=folder / "meshes" / "robot")
    return Exported(document, made, folder)
