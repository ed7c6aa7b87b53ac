"""Names that are code elsewhere stay text: in each medium, as its own reader judges, and at the terminal."""

import csv
import io
import json
import re
import shlex
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from hostile_names import CONTROL, CONTROLS, IN_RAFF, JOINTS, LINKS, NAMES, UNPRINTABLE, arm_of, mjcf, raff, sdf, urdf
from html_elements import Elements

import cinegen
from cinegen.cli import main
from cinegen.cli.files import write_figure
from cinegen.codegen import Function, Language, generate
from cinegen.collision import load_scene
from cinegen.errors import CinegenError
from cinegen.mission import MissionRecorder, Recording, RobotSample, resampled
from cinegen.mission.formats import FORMATS
from cinegen.page import build_page
from cinegen.plotting.map import draw_map
from cinegen.session import Setup
from cinegen.workspace import GridAxis, MapSpecification, Region, make_map
from raff2urdf.cli import main as convert
from raff2urdf.command import output
from raff2urdf.errors import RaffError
from raff2urdf.escape import csv_text, one_line
from raff2urdf.urdf2raff.cli import main as urdf2raff
from raff2urdf.writers import DIALECTS

NAMED = "a name begins with a letter or '_', and has only letters, digits"
SOURCES = {"urdf": arm_of, "sdf": sdf, "xml": mjcf, "raff": raff}


@pytest.fixture(scope="module")
def arm(request, tmp_path_factory):
    """A robot of that source: all its links have hostile names, and so has it."""
    path = tmp_path_factory.mktemp("arm") / f"arm.{request.param}"
    path.write_text(SOURCES[request.param](), encoding="utf-8")
    return cinegen.load(path), path


TABLES = {"table", "thead", "tbody", "tr", "th", "td", "p", "b", "div", "span", "caption", "code", "br"}


def terminal(mechanism, path, tmp_path, typed):
    said = typed("info", path).out
    assert not CONTROL.search(said)
    assert "\nchecked" not in said
    assert all(joint in said for joint in mechanism.joints)
    report = json.loads(typed("info", path, "--json").out)
    assert [joint["name"] for joint in report[0]["joints"]] == list(mechanism.joints)


def notebook(mechanism, path, tmp_path, typed):
    elements = Elements(mechanism._repr_html_()).found
    assert {tag for tag, _, _ in elements} <= TABLES
    assert {name for _, attributes, _ in elements for name in attributes} <= {"class", "style", "colspan", "scope"}
    assert all(joint in "".join(text for *_, text in elements) for joint in mechanism.joints)


def local_page(mechanism, path, tmp_path, typed):
    plain = tmp_path / "plain.urdf"
    plain.write_text(arm_of(tuple(f"n{k}" for k in range(len(mechanism.joints))), "plain"), encoding="utf-8")
    titles = ("</title><script>window.owned = 1</script>", "plain")
    hostile, known = (
        [(tag, set(attributes)) for tag, attributes, _ in Elements(build_page(Setup({name: loaded}), title)).found]
        for name, loaded, title in ((NAMES[6], mechanism, titles[0]), ("plain", cinegen.load(plain), titles[1]))
    )
    assert hostile == known


def c(mechanism, path, tmp_path, typed):
    files = generate(mechanism, Language.C, functions=[Function("fk")], name="arm", source=NAMES[5])
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    if shutil.which("gcc"):
        strict = ["-std=c99", "-trigraphs", "-Wall", "-Wextra", "-Werror"]
        subprocess.run(["gcc", *strict, "-c", "arm.c"], cwd=tmp_path, check=True)
        sections = subprocess.run(["objdump", "-ht", "arm.o"], cwd=tmp_path, check=True, capture_output=True, text=True)
        assert not re.search(r"\bowned\b|\.(init_array|ctors|fini_array)", sections.stdout)
    assert not re.search(r"^\s*(?:void owned|__attribute__)", "\n".join(files.values()), re.MULTILINE)


def javascript(mechanism, path, tmp_path, typed):
    files = generate(mechanism, Language("js"), functions=[Function("fk")], name="arm", source=NAMES[5])
    (tmp_path / "arm.mjs").write_text(files["arm.mjs"], encoding="utf-8")
    if node := shutil.which("node"):
        program = """const before = Object.getOwnPropertyNames(globalThis).length;
            const { default: create, names } = await import("./arm.mjs");
            create().place();
            const added = Object.getOwnPropertyNames(globalThis).length - before;
            console.log(JSON.stringify({ ...names, added }));"""
        run = [node, "--input-type=module", "-e", program]
        done = subprocess.run(run, cwd=tmp_path, check=True, capture_output=True, text=True)
        names = json.loads(done.stdout)
        assert (names["q"], names["added"]) == (list(mechanism.joints), 0)


def table(mechanism, path, tmp_path, typed):
    text = FORMATS["csv"].write(moved(mechanism), mechanism.joints).decode()
    heads = next(csv.reader(io.StringIO(text)))
    assert not any(head.startswith(("=", "+", "-", "@", "\t", "\r")) for head in heads)
    assert [csv_text(head) for head in heads] == ["time", *mechanism.joints]


def ros2(mechanism, path, tmp_path, typed):
    goal = yaml.safe_load(FORMATS["ros2"].write(moved(mechanism), mechanism.joints))
    assert goal["trajectory"]["joint_names"] == list(mechanism.joints)


def npz(mechanism, path, tmp_path, typed):
    arrays = np.load(io.BytesIO(FORMATS["npz"].write(moved(mechanism), mechanism.joints)), allow_pickle=False)
    assert arrays["joints"].tolist() == list(mechanism.joints)


def urscript(mechanism, path, tmp_path, typed):
    for k in range(0, len(mechanism.joints) - 5, 6):
        lines = FORMATS["urscript"].write(moved(mechanism), mechanism.joints[k : k + 6]).decode().splitlines()
        code = [line for line in lines if not line.startswith("#")]
        assert len(lines) == 3 + len(code)
        assert (code[0], code[-1]) == ("def cinegen_motion():", "end")
        assert all(re.fullmatch(r"  (movej\(\[|servoj\(\[|stopj\()[-\d., \[\]a-z=]*\)", line) for line in code[1:-1])


def recording(mechanism, path, tmp_path, typed):
    with MissionRecorder(tmp_path / "run.jsonl", {NAMES[6]: mechanism}) as recorder:
        for tick in range(2):
            recorder.write(0.1 * tick, {NAMES[6]: RobotSample(mechanism.q_home, "IDLE")})
    assert resampled(Recording.load(tmp_path / "run.jsonl"), NAMES[6]).mechanism.joints == mechanism.joints


def robot_files(mechanism, path, tmp_path, typed):
    """RAFF, and what is made of it: URDF in each dialect, SDF and MJCF."""
    file, kinds = path, [["urdf", "--loops", dialect] for dialect in DIALECTS] + [["sdf"], ["mjcf"]]
    if path.suffix != ".raff":
        file = tmp_path / "own.raff"
        assert urdf2raff([str(path), "-o", str(file)]) == 0
        assert not CONTROL.search(file.read_text(encoding="utf-8"))
        mechanism = cinegen.load(file)
        assert len(mechanism.joints) == len(NAMES)
    if path.suffix not in (".raff", ".urdf"):
        return  # the same names again
    for kind, *dialect in kinds:
        folder = tmp_path / "-".join([kind, *dialect])
        assert convert([str(file), "--format", kind, *dialect, "-o", f"{folder}/"]) == 0
        (made,) = folder.glob(f"*.{'xml' if kind == 'mjcf' else kind}")
        names = {element.get("name") for element in ElementTree.parse(made).iter() if element.tag in ("link", "body")}
        assert names >= {*mechanism.nodes} - {"base"}
        assert cinegen.load(made).joints == mechanism.joints


def map_and_picture(mechanism, path, tmp_path, typed):
    marked = [name for name in mechanism.actuated if "frac" in name or "onload" in name]
    first, second = marked or mechanism.actuated[:2]
    axes = (GridAxis(first, 0.0, 0.1, 2), GridAxis(second, 0.0, 0.1, 2))
    dataset = make_map(MapSpecification(mechanism, Region(axes), ("sigma_1",)), tmp_path / "map.zarr", workers=1)
    assert {first, second} <= {*dataset.dims} | {str(coord.attrs.get("long_name")) for coord in dataset.coords.values()}
    json.loads((tmp_path / "map.zarr" / "zarr.json").read_text(encoding="utf-8"))
    write_figure(tmp_path / "map.svg", draw_map(dataset, "sigma_1", name=NAMES[6]), quiet=True)
    texts = ElementTree.parse(tmp_path / "map.svg")
    assert not [element for element in texts.iter() if element.tag.rpartition("}")[2] == "script"]
    dataset.close()


def moved(mechanism):
    """A motion of two samples: what writers of formats take."""
    return SimpleNamespace(
        name=CONTROLS, mechanism=mechanism, rate=10.0, seconds=0.1, times=np.array([0.0, 0.1]),
        positions=lambda joints: np.zeros((2, len(joints))), velocities=lambda joints: np.zeros((2, len(joints))),
    )  # fmt: skip


WRITERS = (
    terminal, notebook, local_page, c, javascript, table, ros2, npz, urscript, recording, robot_files, map_and_picture,
)  # fmt: skip
OF_SOURCES = (terminal, recording, robot_files)
"""Those that read or keep what a source has said; others know the robot alone."""


@pytest.mark.parametrize(
    ("arm", "writer"),
    [(source, writer) for source in SOURCES for writer in WRITERS if source == "urdf" or writer in OF_SOURCES],
    indirect=["arm"],
)
def test_names_stay_text(arm, writer, tmp_path, typed):
    writer(*arm, tmp_path, typed)


@pytest.mark.parametrize("name", UNPRINTABLE)
@pytest.mark.parametrize("source", SOURCES)
def test_names_that_cannot_be_seen_are_refused(text_file, source, name):
    path = text_file(f"arm.{source}", SOURCES[source]((name,)))
    with pytest.raises((cinegen.CinegenError, RaffError)) as refused:
        cinegen.load(path)
    assert not CONTROL.search(one_line(str(refused.value)))


def test_raff_refuses_the_others_and_says_why():
    for name in {*NAMES} - {*IN_RAFF}:
        if '"' not in name:  # which ends a name in RAFF
            with pytest.raises((cinegen.CinegenError, RaffError), match=NAMED) as refused:
                cinegen.load(raff((name,)))
            assert name in str(refused.value)


def test_titles_of_pictures(tmp_path, robot):
    """matplotlib reads a formula between two dollars, which may be invalid."""
    arm = robot("planar_3r")
    axes = tuple(GridAxis(name, 0.0, 0.1, 2) for name in arm.actuated[:2])
    with make_map(MapSpecification(arm, Region(axes), ("sigma_1",)), tmp_path / "map.zarr", workers=1) as dataset:
        write_figure(tmp_path / "map.png", draw_map(dataset, "sigma_1", name=r"$\frac{$"), quiet=True)
        assert (tmp_path / "map.png").stat().st_size > 5000


def test_obstacles_of_a_scene(text_file, root, typed):
    balls = "".join(
        f"[[obstacle]]\nname = {json.dumps(name, ensure_ascii=False)}\n"
        "kind = 'sphere'\nradius = 0.1\npoint = [5, 5, 5]\n"
        for name in NAMES
    )
    path = text_file("scene.toml", f"robot = '{root}/robots/planar_3r.raff'\ngoal = {{ point = [0.9, 0.9] }}\n{balls}")
    scene = load_scene(path)
    assert [obstacle.name for obstacle in scene.obstacles] == [*NAMES]
    assert {tag for tag, _, _ in Elements(scene._repr_html_()).found} <= TABLES
    said = typed("plan", path, code=1).out
    assert not CONTROL.search(said)


@pytest.mark.parametrize("name", [*NAMES[::8], *UNPRINTABLE])
def test_columns_of_measurements_and_keys_of_tasks(tmp_path, root, typed, name):
    file = io.StringIO()
    csv.writer(file).writerows([["pose", name], ["a", "0"]])
    (tmp_path / "m.csv").write_text(file.getvalue(), encoding="utf-8")
    (tmp_path / "task.toml").write_text(f"{json.dumps(name, ensure_ascii=False)} = 1\n", encoding="utf-8")
    robot = str(root / "robots/planar_3r.raff")
    for command in (
        ["calibrate", robot, str(tmp_path / "m.csv")],
        ["synthesize", robot, "--task", f"{tmp_path}/task.toml"],
    ):
        said = typed(*command, code=1).err
        assert not CONTROL.search(said)
        assert len(said.splitlines()) <= 5  # of a task four: nothing else is there either


# --- at the terminal --------------------------------------------------------------------------------------------------
# Names of robots are text, not commands: at the terminal, and in the files that commands write.


def test_a_certificate_adds_no_line_to_what_is_said_of_it(root, tmp_path, typed, capsys):
    path = str(tmp_path / "proof.json")
    assert main(["prove", str(root / "robots/five_bar.raff"), "--over", "x=-10..10mm,y=450..460mm", "-o", path]) == 0
    certificate = json.loads(Path(path).read_text(encoding="utf-8"))
    for variable in certificate["variables"]:
        variable["name"] += CONTROLS
    Path(path).write_text(json.dumps(certificate | {"robot": CONTROLS}), encoding="utf-8")
    capsys.readouterr()
    lines = typed("check-proof", path).out.splitlines()
    assert len(lines) == 2  # the result and the region
    assert all(line.isprintable() for line in lines)


def test_an_error_quotes_the_ends_of_a_very_long_text(typed):
    said = typed("info", "planar_3r", "--robot", f"begin{'x' * 1_000_000}end", code=1).err
    assert len(said) < 5000
    assert re.search("beginx+ [.]{3} x+end", said)


def test_whatever_reaches_a_stream_of_a_command_is_text(capsys):
    def command():
        print("out\x1b[2J\x9b2J\u202e")
        print("error\x1b[2J\r\u202e\tx", file=sys.stderr)
        raise CinegenError("a\x1b[2J")

    assert output.run("thing", command) == output.DEFECT
    said = capsys.readouterr()
    assert said.out == "out\\u001b[2J\\u009b2J\\u202e\n"
    assert said.err.startswith("error\\u001b[2J\\u000d\\u202e\tx\n".replace("\\u000d", "\\r"))
    assert "\x1b" not in said.err


def test_the_name_of_a_file_is_text_in_a_picture(root, tmp_path, typed):
    """Comments of an SVG quote titles."""
    path = tmp_path / f"\x1b{CONTROLS}--><script>.raff"
    shutil.copy(root / "robots/four_bar.raff", path)
    picture = str(tmp_path / "a.svg")
    said = typed("tolerance", path, "--sigma", "link*.d=1mm", "--samples", "0", "--plot", picture)
    assert not CONTROL.search(said.out + said.err)
    tags = {element.tag.rpartition("}")[2] for element in ElementTree.parse(picture).iter()}
    assert "script" not in tags
    assert "checked: all is well" in Path(picture).read_text(encoding="utf-8")  # not what its file calls the robot


def test_two_names_that_are_shown_alike_are_refused(robot, tmp_path, typed):
    arm = robot("planar_3r")
    with MissionRecorder(tmp_path / "run.jsonl", {name: arm for name in ("a\nb", "a\\nb")}) as recorder:
        recorder.write(0.0, {})
    said = typed("export", tmp_path / "run.jsonl", "--to", "csv", code=1)
    assert "two names differ only in characters that can't be printed" in said.err


def test_code_of_a_robot_with_such_a_name_stays_in_its_folder(tmp_path):
    path = tmp_path / "in" / "x.urdf"
    path.parent.mkdir()
    path.write_text(urdf("../../owned", LINKS[:2], JOINTS[:2]), encoding="utf-8")
    before = {entry for entry in tmp_path.rglob("*")}
    assert main(["generate", str(path), "--to", "c", "-o", str(tmp_path / "out"), "--functions", "fk"]) == 0
    assert {entry.parent.name for entry in {*tmp_path.rglob("*")} - before} == {tmp_path.name, "out"}


@pytest.mark.filterwarnings("default::raff2urdf.errors.RaffWarning")
def test_commands_that_messages_propose_are_one_word(tmp_path, text_file, typed):
    path = text_file("a; touch owned.urdf", urdf("x", ("a", "b"), ("j", "k")))
    sidecar = tmp_path / "a; touch owned.constraints.json"
    sidecar.mkdir()
    proposed = shlex.split(typed("info", path, code=1).err.partition("leave it out with ")[2])
    assert proposed == ["--ignore", sidecar.name]
    assert main(["info", str(path), *proposed]) == 0
