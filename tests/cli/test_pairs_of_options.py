"""All pairs of options of each command: each option of a pair has an effect, or the call is refused.

The library is `Anything`: what a command asks of it, prints and refuses is what the command does with its options. An
option has an effect where that differs from the same call without it.
"""

import io
import itertools
import shlex
import sys
from contextlib import redirect_stderr, redirect_stdout
from typing import get_args

import pytest
import typer
from anything import Anything, library_of_anything
from test_wrong_arguments import command_of
from variants import slow

# The calls that pairs are added to: one for each thing that a command can do.
CALLS = {
    "cinegen demo": ["planar_3r", "--list", "clock", "planar_3r --video x.mp4 --seconds 1"],
    "cinegen info": ["arm.urdf"],
    "cinegen ik": ["arm.raff --at 1,2,3"],
    "cinegen modes": ["arm.raff", "arm.raff --view", "arm.raff --view --video x.mp4 --seconds 1"],
    "cinegen singular": ["arm.raff", "arm.raff --over x,y", "run.jsonl"],
    "cinegen forces": ["arm.raff", "arm.raff --trajectory run.jsonl"],
    "cinegen tolerance": ["arm.raff --sigma a=1mm", "arm.raff --sigma a=1mm --samples 0"],
    "cinegen calibrate": ["arm.raff m.csv", "arm.raff m.csv --propose 2"],
    "cinegen synthesize": ["arm.raff --task task.toml"],
    "cinegen map": [
        "arm.raff", "arm.raff --view", "arm.raff --vary link2.d=1..2", "arm.raff --vary link2.d=1..2 --plot p.png",
        "arm.raff --line 0,0,0..1,1,1",
        "arm.raff --scene scene.toml", "arm.raff --over azimuth,elevation", "arm.raff --plot p.png",
    ],
    "cinegen compare": ["a.zarr b.zarr", "a.zarr b.zarr --plot p.png"],
    "cinegen prove": ["arm.raff --over x=1..2"],
    "cinegen check-proof": ["a.json"],
    "cinegen plan": [
        "scene.toml", "scene.toml --modes any", "scene.toml --view", "scene.toml --planner rrtconnect",
        "scene.toml --view --video x.mp4 --seconds 1",
    ],
    "cinegen drive": [
        "arm.raff", "--scene scene.toml", "arm.raff --snapshot s.html", "arm.raff --snapshot s.html --seconds 2",
        "arm.raff --video x.mp4 --seconds 1",
    ],
    "cinegen replay": ["run.jsonl", "run.jsonl --video x.mp4 --seconds 1"],
    "cinegen export": ["run.jsonl --to csv", "run.jsonl --to csv --torques"],
    "cinegen generate": ["arm.raff --to c", "arm.raff --to js", "arm.raff --to c --functions fk"],
    "cinegen page": ["arm.raff"],
    "cinegen close": ["arm.raff"],
    "cinegen heal": ["arm.raff out.x"],
    "cinegen validate": [""],
    "cinegen sensors": ["", "arm.raff", "--monitor tcp://x"],
    "raff2urdf": ["arm.raff", "arm.raff --check", "arm.raff --format sdf"],
    "urdf2raff": ["arm.urdf"],
}  # fmt: skip
LONG = ("cinegen drive", "cinegen map", "cinegen modes", "cinegen plan")
"""Commands with so many options that the pairs of their first call alone are quick."""
VALUES = {
    "--loop": "a=ball", "--follow": "line", "--show": "reachable",
    "--at": "x=1", "--values": "x=1", "--velocity": "a=1", "--acceleration": "a=1", "--gravity": "0,0,1",
    "--payload": "2", "--wrench": "a=1,2,3", "--sigma": "b=1mm", "--play": "b=1mm", "--encoder": "b=1deg",
    "--package": "a=b", "--xacro-arg": "a=b", "--line": "0,0,0..1,1,1", "--centre": "1,2,3", "--along": "1,2,3",
    "--stiffness": "a=3", "--vary": "link2.d=1..2", "--box": "x=0..1", "--over": "x,y", "--size": "640x480",
    "--modes": "any", "--functions": "ik", "--to": None, "--task": "tool", "--robot": "anything",
    "--density": "3", "--clearance": "10mm",
}  # fmt: skip
REPLACED = (
    "runpy.run_path", "webbrowser.open", "cinegen.cli.files.check_new", "cinegen.cli.robots.info._text",
    "cinegen.cli.motion.plan._task", "cinegen.cli.design.calibrate._text", "cinegen.cli.study.map.summary",
    "cinegen.cli.study.forces._along", "cinegen.cli.motion.ik.pose_task", "cinegen.cli.study.modes.pose_task",
    "cinegen.cli.motion.ik._lines", "cinegen.cli.robots.demo.replace", "cinegen.cli.motion.drive.replace",
    "cinegen.cli.motion.plan_recording.replace", "cinegen.cli.served_page.replace", "cinegen.cli.robots.heal.signed",
)  # fmt: skip
"""What is called in no library, or needs more than anything."""
MODULES = ("cinegen.cli", "raff2urdf.cli", "raff2urdf.urdf2raff.cli", "raff2urdf.command.read_flags")
BY_INPUT = {"cinegen singular": ["--units"], "cinegen compare": ["--units"], "cinegen map": ["--yes", "--units"]}
"""Options whose effect is in the library's texts, or in a question about large maps."""
LEFT_OUT = {"--help", "--version", "--install-completion", "--show-completion", "--grammar"}


def type_of(option):
    """The type of an option's value, without None."""
    kinds = [kind for kind in get_args(option.type_descriptor.annotation) if isinstance(kind, type) or get_args(kind)]
    return next((kind for kind in kinds if kind is not type(None)), option.type_descriptor.annotation)


def options_of(command, call):
    """Each option of a command with a value that is not its default, as words."""
    rules = command.callback.rules
    words_of = {}
    for option in command.params:
        name = max(option.opts, key=len)
        if option.param_type_name == "argument" or name in LEFT_OUT or name in call:
            continue
        if option.is_flag:
            words = [name]
        elif name in VALUES:
            words = [name, VALUES[name]]
        elif choices := get_args(type_of(option)):
            words = [name, next(choice for choice in choices[::-1] if choice != option.default)]
        elif option.type_descriptor.parameter_info.parser or type_of(option) in (int, float):
            words = [name, "7"]
        else:
            endings = rules[option.name].endings if option.name in rules else ()
            words = [name, f"{option.name}{endings[0] if endings else ''}"]
        if None not in words:
            words_of[name] = words
    return words_of


@pytest.fixture
def answer(tmp_path, monkeypatch):
    """`answer(command, words)`: whether the call is refused, and all that it does."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO()))
    monkeypatch.setenv("DISPLAY", ":0")
    for name in REPLACED:
        monkeypatch.setattr(name, Anything(name.rpartition(".")[2]))

    def call(command, words):
        text = io.StringIO()
        with library_of_anything(MODULES) as notes, redirect_stdout(text), redirect_stderr(text):
            try:
                code = command.main(words, standalone_mode=False)
            except typer.Exit as error:
                code = error.exit_code
            except Exception as error:
                code, said = getattr(error, "exit_code", 1), getattr(error, "message", str(error))
                text.write(f"{type(error).__name__}: {said}")
        for path in sorted(tmp_path.rglob("*")):
            if path.is_file():
                notes.append(path.name)
                path.unlink()
        return code == 2, text.getvalue(), tuple(notes)

    return call


@pytest.mark.parametrize(
    ("name", "call"),
    [
        slow((name, call))[0] if name in LONG and call != calls[0] else (name, call)
        for name, calls in CALLS.items()
        for call in calls
    ],
)
def test_each_option_of_a_pair_has_an_effect_or_is_refused(answer, name, call):
    command = command_of(name)
    base = shlex.split(call)
    options = options_of(command, [*base, *BY_INPUT.get(name, ())])
    nothing = answer(command, base)
    assert not nothing[0], nothing
    alone = {option: answer(command, [*base, *words]) for option, words in options.items()}
    idle = [option for option, said in alone.items() if said == nothing]
    effective = {option: said for option, said in alone.items() if not said[0] and said != nothing}
    for option, other in itertools.combinations(effective, 2):
        both = answer(command, [*base, *options[option], *options[other]])
        if not both[0]:
            idle += [f"{b} with {a}" for a, b in ((option, other), (other, option)) if both == effective[a]]
    assert not idle, "\n" + "\n".join(idle)
