"""The readers: for each, files that it reads, how they are mutated, how it is called, and what must hold of its result.

A new reader is a new entry in `READERS`.
"""

import os
import re
import shutil
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cache
from io import StringIO
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import numpy as np

import cinegen
import raff2urdf
from campaign import mutation as m
from campaign.corpus import Seed, entries, seed_of
from campaign.judge import Finding, Outcome, judged
from campaign.workers import Campaign
from cinegen.cli import main
from cinegen.collision.scene_file import load_scene
from cinegen.mission import MissionRecorder, Recording, RobotSample
from cinegen.toolpath.seam_file import open_seam
from cinegen.workspace import open_map
from raff2urdf.graphics.meshes import Graphics
from raff2urdf.raff.document import RaffBase, RaffRobot
from raff2urdf.raff.syntax import STATEMENTS
from raff2urdf.readers.ignored import _MJCF, _SDF, _URDF

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Reader:
    """A reader.

    Attributes:
        name: of the format.
        seeds: returns files that it can read, from a folder with all formats of some robots.
        read: reads a file.
        mutations: of the file.
        words: of the format.
        checks: yields what is wrong with a result.
        summary: of a result: the same for files of the same meaning.
        names_file: whether errors name the file.
    """

    name: str
    seeds: Callable[[Path], list[Seed]]
    read: Callable[[Path], Any]
    mutations: tuple[m.Mutation, ...]
    words: tuple[str, ...] = ()
    checks: Callable[[Any], Iterator[str]] = lambda _: iter(())
    summary: Callable[[Any], Any] = lambda _: None
    names_file: bool = True


# --- what must hold of a mechanism -------------------------------------------------------------------------------


def wrong_with(mechanism: cinegen.Mechanism) -> Iterator[str]:
    """Yield what is wrong with a mechanism."""
    model, q = mechanism.model, mechanism.q_home
    lower, upper = mechanism.limits.lower, mechanism.limits.upper
    placements = [placement.homogeneous for placement in model.jointPlacements]
    if not all(np.isfinite(array).all() for array in (q, *placements)):
        yield "numbers that are not finite"
    if np.isnan(lower).any() or np.isnan(upper).any() or (lower > upper).any():
        yield "limits that are not ordered"
    if not np.isfinite(mechanism.length) or mechanism.length <= 0.0:
        yield f"characteristic length {mechanism.length}"
    if mechanism.is_constrained and not mechanism.closure(q) <= 1e-6:
        yield f"home is open by {mechanism.closure(q)}"
    if len(set(mechanism.nodes)) != len(mechanism.nodes):
        yield "two nodes of one name"
    if not 0 <= mechanism.mobility <= model.nv:
        yield f"mobility {mechanism.mobility} of {model.nv} joints"


def meaning_of(mechanism: cinegen.Mechanism) -> Any:
    """Return what two files of the same meaning agree on."""
    loops = sorted((loop.name, loop.kind.name) for loop in mechanism.loops)
    q = [round(float(value), 6) for value in mechanism.q_home]
    nq, couplings = mechanism.model.nq, len(mechanism.couplings)
    return mechanism.nodes, nq, mechanism.mobility, loops, couplings, mechanism.actuated, q


# --- seeds -------------------------------------------------------------------------------------------------------

_SMALL = ("four_bar", "five_bar", "planar_3r", "scara", "differential_wrist", "belt_five_bar", "planetary_gear")


def make_all(folder: Path) -> None:
    """Make files of all formats in a folder, from the robots of the repository."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in _SMALL:
            path = ROOT / "robots" / f"{name}.raff"
            for dialect in ("json", "constraint", "urdf+", "closing-frames", "mimic", "robot.yaml"):
                try:
                    raff2urdf.convert(path, folder / dialect / name, dialect=dialect)
                except raff2urdf.RaffError:  # the dialect has no notation for it
                    shutil.rmtree(folder / dialect / name, ignore_errors=True)
            for kind in ("sdf", "mjcf"):
                raff2urdf.convert(path, folder / kind / name, format=kind)
    make_recording(folder / "recording")
    over, out = "x=-0.4..0.4:4,y=-0.4..0.4:4", str(folder / "map/map.zarr")
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        assert main(["map", str(ROOT / "robots/planar_3r.raff"), "--over", over, "--workers", "1", "-o", out]) == 0


def make_recording(folder: Path, names: tuple[str, ...] = ("planar_3r", "four_bar")) -> None:
    """Make a short recording of some robots."""
    folder.mkdir(parents=True, exist_ok=True)
    robots = {name: cinegen.load(ROOT / f"robots/{name}.raff") for name in names}
    with MissionRecorder(folder / "mission.jsonl", robots) as recorder:
        for i in range(6):
            recorder.write(0.1 * i, {name: RobotSample(robot.q_home, "IDLE") for name, robot in robots.items()})


def _of_folder(folder: Path, subject: str, main: str | None = None) -> list[Seed]:
    """Return the seeds of each folder in a folder: all its files, the subject by its ending."""
    seeds = []
    for subfolder in sorted(folder.iterdir()) if folder.is_dir() else ():
        files = {path.name: path.read_bytes() for path in sorted(subfolder.iterdir()) if path.is_file()}
        mains = [name for name in files if name.endswith(main or subject)]
        seeds += [Seed(files, name, (mains or [name])[0]) for name in files if name.endswith(subject)]
    return seeds


def _alone(*paths: Path) -> list[Seed]:
    return [Seed({path.name: path.read_bytes()}, path.name, path.name) for path in paths]


def _raff(_: Path) -> list[Seed]:
    paths = sorted((ROOT / "robots").glob("*.raff"))
    return _alone(*(path for path in paths if path.stat().st_size < 3000), ROOT / "tests/robots/data/peaucellier.raff")


def _urdf(folder: Path) -> list[Seed]:
    declared = [seed for dialect in _DIALECTS for seed in _of_folder(folder / dialect, ".urdf")]
    alone = [Seed({seed.subject: seed.files[seed.subject]}, seed.subject, seed.subject) for seed in declared]
    return [*alone, *_of_folder(folder / "json", ".urdf")]


_DIALECTS = ("urdf+", "closing-frames", "mimic", "constraint")


def _robot_yaml(folder: Path) -> list[Seed]:
    seeds = _of_folder(folder / "robot.yaml", ".yaml", ".urdf")
    kept = [{name: data for name, data in seed.files.items() if not name.endswith(".json")} for seed in seeds]
    return [seed._replace(files=files) for seed, files in zip(seeds, kept, strict=True)]


def _scene(_: Path) -> list[Seed]:
    robot = {"planar_3r.raff": (ROOT / "robots/planar_3r.raff").read_bytes()}
    seeds = []
    for path in sorted((ROOT / "robots/scenes").glob("*.toml")):
        text = path.read_bytes().replace(b"../planar_3r", b"planar_3r")
        if b"robot =" not in text or b"planar_3r" in text:
            seeds.append(Seed(robot | {path.name: text}, path.name, path.name))
    return seeds


def _recording(folder: Path) -> list[Seed]:
    return _alone(folder / "recording/mission.jsonl")


def _none(_: Path) -> list[Seed]:
    """The corpus has all."""
    return []


def _graphics(ending: str) -> Callable[[Path], list[Seed]]:
    return lambda _: [
        Seed({path.name: b"\n".join(path.read_bytes().split(b"\n")[:400])}, path.name, path.name)
        for path in sorted((ROOT / "robots/graphics").glob(f"*.{ending}"))
    ]


def _zarr(folder: Path) -> list[Seed]:
    path = folder / "map"
    files = {str(file.relative_to(path)): file.read_bytes() for file in sorted(path.rglob("*")) if file.is_file()}
    return [Seed(files, name, "map.zarr") for name in files]


# --- reading -----------------------------------------------------------------------------------------------------


def _read_recording(path: Path) -> Any:
    recording = Recording.load(path)
    recording.at(0.25)
    recording.placements_at(0.25)
    return recording


def _wrong_with_recording(recording: Any) -> Iterator[str]:
    if not np.isfinite(recording.times).all() or (np.diff(recording.times) < 0).any():
        yield "times that do not increase"
    if not all(np.isfinite(q).all() for q in recording.q.values()):
        yield "configurations that are not finite"


def _read_seam(path: Path) -> Any:
    return open_seam(f"seam:{path}?distance=5mm")


def _wrong_with_seam(seam: Any) -> Iterator[str]:
    if not np.isfinite(seam.length) or seam.length <= 0.0:
        yield f"length {seam.length}"


def _wrong_with_scene(scene: Any) -> Iterator[str]:
    if not np.isfinite(scene.safety) or scene.safety < 0.0:
        yield f"safety {scene.safety}"


def _read_graphics(path: Path) -> Any:
    """Read a graphic file as a robot does that names it: what can't be drawn is reported, never raised."""
    robot = RaffRobot(name="r", base=RaffBase(filenames=(path.name,)))
    drawings, reasons = Graphics(robot, path.parent, path.parent / "meshes").of(robot.base)
    return drawings, reasons


def _wrong_with_drawings(graphics: Any) -> Iterator[str]:
    drawings, reasons = graphics
    if not drawings and not reasons:
        yield "neither drawn nor reported"


# --- the table ---------------------------------------------------------------------------------------------------


def _tags(table: Any) -> tuple[str, ...]:
    return tuple({*table, *(tag for tags in table.values() for tag in tags)})


_RAFF_WORDS = tuple({word for block in STATEMENTS.values() for word in block})
_DIALECT_WORDS = (
    *("constraint", "loop", "coupling", "loop_joint", "predecessor", "successor", "mimic", "multiplier", "offset"),
    *("independent", "type", "name", "link", "joint", "parent", "child", "origin", "xyz", "rpy", "axis", "limit"),
    *("lower", "upper", "revolute", "prismatic", "continuous", "fixed", "floating", "planar", "spherical"),
    *("universal", "ball", "drake:joint", "linear_bushing_rpy", "gazebo", "plugin"),
)
_MJCF_WORDS = (
    *_tags(_MJCF),
    *("connect", "weld", "joint", "tendon", "class", "childclass", "euler", "quat", "axisangle", "ref", "range"),
    *("ball", "free", "slide", "hinge"),
)
_SCENE_WORDS = (
    *("robot", "node", "mobile", "start", "goal", "obstacle", "kind", "disc", "box", "capsule", "polygon"),
    *("sphere", "radius", "point", "points", "mesh", "pose"),
)
_YAML_WORDS = (
    *("closed_loop", "type", "name_mot", "joint_name", "joint_type", "SPHERICAL", "UJOINT_XY", "3d", "6d"),
    *("closures", "pin_loops", "ball_loops", "link_a", "link_b", "parent_xyz", "child_xyz", "point", "axis"),
    *("actuated_joints",),
)
_SCHEMA_WORDS = tuple(set(re.findall(r'"(\w+)"', (ROOT / "raff2urdf/constraints.schema.json").read_text())))
_RECORDING_WORDS = ("robots", "obstacles", "tasks", "status", "q", "t", "null")


def _mechanism(name: str, seeds: Any, mutations: tuple[m.Mutation, ...], words: tuple[str, ...]) -> Reader:
    return Reader(name, seeds, cinegen.load, mutations, words, wrong_with, meaning_of)


READERS = {
    reader.name: reader
    for reader in (
        _mechanism("raff", _raff, m.RAFF, _RAFF_WORDS),
        _mechanism("urdf", _urdf, m.XML, (*_DIALECT_WORDS, *_tags(_URDF))),
        _mechanism("constraints", lambda folder: _of_folder(folder / "json", ".json", ".urdf"), m.JSON, _SCHEMA_WORDS),
        _mechanism("sdf", lambda folder: _of_folder(folder / "sdf", ".sdf"), m.XML, _tags(_SDF)),
        _mechanism("mjcf", lambda folder: _of_folder(folder / "mjcf", ".xml"), m.XML, _MJCF_WORDS),
        _mechanism("xacro", _none, m.XML, _DIALECT_WORDS),
        _mechanism("robot_yaml", _robot_yaml, m.YAML, _YAML_WORDS),
        _mechanism("loop_closures", _none, m.YAML, _YAML_WORDS),
        Reader("scene", _scene, load_scene, m.JSON, _SCENE_WORDS, _wrong_with_scene),
        Reader("recording", _recording, _read_recording, m.PLAIN, _RECORDING_WORDS, _wrong_with_recording),
        Reader("seam", _none, _read_seam, m.PLAIN, ("x", "nz", "mm", "deg"), _wrong_with_seam),
        Reader("nff", _graphics("nff"), _read_graphics, m.PLAIN, (), _wrong_with_drawings),
        Reader("dxf", _graphics("dxf"), _read_graphics, m.PLAIN, (), _wrong_with_drawings),
        Reader("mesh", _none, _read_graphics, m.PLAIN, (), _wrong_with_drawings),
        Reader("map", _zarr, lambda path: open_map(path).load(), m.JSON, ("shape", "chunks", "codecs", "attributes")),
    )
}


# --- cases -------------------------------------------------------------------------------------------------------


class Case(NamedTuple):
    """A file to be read.

    Attributes:
        name: such as "raff:12".
        reader: of the file.
        index: of its seed.
        data: the contents of the seed's subject.
        compare: returns what is wrong when the original and this file are compared; None: nothing.
    """

    name: str
    reader: Reader
    index: int
    data: bytes
    compare: Callable[[Outcome, Outcome], list[tuple[str, str, str]]] | None = None


class Files(Campaign):
    """Cases of readers: a mutated file is read. The same number is the same file.

    Args:
        folder: to work in; made anew.
        seed: of the campaign.
        readers: those of the package unless given.
    """

    limit = 20.0

    def __init__(self, folder: Path, seed: int = 0, readers: Sequence[Reader] = ()) -> None:
        self.folder, self.seed, self.readers = folder, seed, tuple(readers or READERS.values())
        made = folder / "made"
        if any(reader in READERS.values() for reader in self.readers):
            make_all(made)
        self.seeds = {r.name: [*r.seeds(made), *map(seed_of, entries(r.name, "read"))] for r in self.readers}

    def begin(self, worker: int) -> None:
        """Begin in a process of its own, with a folder of its own."""
        self.folder = self.folder / f"worker{worker}"
        for name, seeds in self.seeds.items():
            for i, seed in enumerate(seeds):
                write(seed.files, self.folder / name / str(i))

    def case(self, number: int) -> Case:
        """Return a case."""
        reader = self.readers[number % len(self.readers)]
        name = f"{reader.name}:{number // len(self.readers)}"
        rng = Random(f"{self.seed}/{name}")
        i = rng.randrange(len(self.seeds[reader.name]))
        seed = self.seeds[reader.name][i]
        data, kind = seed.files[seed.subject], rng.random()
        if kind < 0.2 and reader.mutations in m.MISSPELL and not seed.subject.endswith(".toml"):
            table, compare = (m.MISSPELL, _lost) if kind < 0.1 else (m.RELAYOUT, _changed)
            return Case(name, reader, i, table[reader.mutations](rng, data, reader.words), compare)
        for _ in range(rng.choice((1, 1, 1, 2, 2, 3, 5))):
            data = rng.choice(reader.mutations)(rng, data, reader.words)
        return Case(name, reader, i, data)

    def evidence(self, number: int) -> tuple[str, dict[str, bytes]]:
        """Return the name of a case, and its files."""
        case = self.case(number)
        seed = self.seeds[case.reader.name][case.index]
        return case.name, {**seed.files, seed.subject: case.data}

    def run(self, number: int) -> tuple[dict[str, int], dict[str, Any], list[Finding]]:
        """Run a case; return what is counted, what is measured, and the findings."""
        case = self.case(number)
        outcome = self.read(case)
        findings = []
        if outcome.broken:
            name, files = self.evidence(number)
            findings = [Finding(name, *fault, files) for fault in dict.fromkeys(outcome.broken)]
        return {"cases": 1, outcome.status: 1}, {"slowest": [outcome.seconds, case.name]}, findings

    def read(self, case: Case) -> Outcome:
        """Read a case's file."""
        reader, seed = case.reader, self.seeds[case.reader.name][case.index]
        folder = self.folder / reader.name / str(case.index)
        (folder / seed.subject).write_bytes(case.data)
        outcome = read(reader, folder, seed)
        if case.compare is not None:
            outcome.broken += case.compare(self._original(reader, case.index), outcome)
        return outcome

    @cache  # noqa: B019 (lives as long as the process)
    def _original(self, reader: Reader, i: int) -> Outcome:
        seed = self.seeds[reader.name][i]
        return self.read(Case(reader.name, reader, i, seed.files[seed.subject]))


def read(reader: Reader, folder: Path, seed: Seed) -> Outcome:
    """Read files from a folder that has them."""
    names = [os.path.basename(name) for name in (*seed.files, seed.main)] if reader.names_file else []
    outcome = judged(lambda: reader.read(folder / seed.main), names, reader.checks)
    if outcome.status == "read":
        outcome.value = reader.summary(outcome.value)
    return outcome


def _lost(original: Outcome, outcome: Outcome) -> list[tuple[str, str, str]]:
    """A name that is misspelt must not lose a loop in silence."""
    if original.status != "read" or outcome.status != "read" or original.value is None:
        return []
    had, has = (len(loops) + couplings for _, _, _, loops, couplings, *_ in (original.value, outcome.value))
    if has < had and not outcome.message:
        return [("silent loss", "a misspelt name", f"{had} loops and couplings became {has}, and nothing is reported")]
    return []


def _changed(original: Outcome, outcome: Outcome) -> list[tuple[str, str, str]]:
    """Blanks, comments and the order of attributes mean nothing."""
    if (original.status, original.value) == (outcome.status, outcome.value):
        return []
    detail = f"{original.value}\n{outcome.value}\n{outcome.message}"
    return [("layout matters", f"{original.status} became {outcome.status}", detail)]


def write(files: dict[str, bytes], folder: Path) -> None:
    """Write files in a folder."""
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
