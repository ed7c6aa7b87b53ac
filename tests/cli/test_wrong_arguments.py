"""Every argument and option of every command, with values that make no sense: a sentence, never a traceback.

The commands and their options are those that the command lines declare, so that a new option is tested, too. Each gets
a value of a fixed, random choice, in this process.
"""

import gc
import io
import os
import random
import shutil
import sys

import pytest
import typer

import cinegen.cli
import raff2urdf.cli
import raff2urdf.urdf2raff.cli
from cinegen.cli.served_page import PageOptions

# A call of each command that is right and quick; each value that is tried is written in place of one of its arguments,
# or behind them.
CALLS = {
    "cinegen demo": "planar_3r",
    "cinegen info": "four_bar.raff",
    "cinegen ik": "planar_3r.raff --at 0.5,0.1,0",
    "cinegen modes": "four_bar.raff",
    "cinegen singular": "planar_3r.raff",
    "cinegen forces": "four_bar.raff --massless",
    "cinegen tolerance": "four_bar.raff --sigma link2.d=0.1mm --samples 100",
    "cinegen calibrate": "planar_3r.raff measurements.csv --folds 0",
    "cinegen synthesize": "planar_3r.raff --task task.toml -o out.raff",
    "cinegen map": "planar_3r.raff --over x,y --grid 2 --workers 1 -o out.zarr",
    "cinegen compare": "map.zarr map.zarr",
    "cinegen prove": "five_bar.raff --over x=-10..10mm,y=0.45..0.46 -o out.json",
    "cinegen check-proof": "proof.json",
    "cinegen plan": "unreachable.toml",
    "cinegen drive": "four_bar.raff",
    "cinegen replay": "run.jsonl",
    "cinegen export": "run.jsonl --to csv -o out.csv",
    "cinegen generate": "four_bar.raff --to c -o out",
    "cinegen page": "four_bar.raff -o out.html",
    "cinegen close": "four_bar.raff",
    "cinegen heal": "tilted.raff out.raff",
    "cinegen validate": "TwoDofs",
    "cinegen sensors": "",
    "cinegen compile": "",
    "raff2urdf": "four_bar.raff -o out/",
    "urdf2raff": "arm.urdf -o out.raff",
}

PROGRAMS = {"cinegen": cinegen.cli, "raff2urdf": raff2urdf.cli, "urdf2raff": raff2urdf.urdf2raff.cli}

NAMES = ("", "jont1", "nowhere/x", "folder", "empty", "binary", "text.toml", "a b", "-x", "--", "\udcff", "ä", "%s")
NUMBERS = ("nan", "inf", "-1", "0", "1e400", "1e-300", "1e308", "9" * 20, "1,2,3", "nan,nan,nan", "1e308,0,0", "1e9m")
PAIRS = ("jont1=10", "joint1=nan", "joint1=1e300", "x=nan", "x=nan..1", "x=0..1e308", "x=0..0:0", "a=b=c", "=", "..")
PLACES = ("/dev/full", "/dev/zero", "tcp://x", "file:///x", "[]")
MORE = {"--monitor": ["--seconds", "0.01"]}  # else it waits for a device to be plugged in


def command_of(command):
    program, *names = command.split()
    top_command = typer.main.get_command(PROGRAMS[program].app)
    return top_command.commands[names[0]] if names else top_command


def parameters(command):
    """Those of a command that take a value."""
    left_out = {"help", "version", "install_completion", "show_completion"}
    return [
        arg for arg in command_of(command).params if arg.name not in left_out and not getattr(arg, "is_flag", False)
    ]


def mistaken(command):
    """Calls of a command in which one argument or option is wrong."""
    call, chosen = CALLS[command].split(), random.Random(command)
    declared = parameters(command)
    arguments = [parameter for parameter in declared if parameter.param_type_name == "argument"]
    of_reading = {parameter.name for parameter in parameters("cinegen info")} if command != "cinegen info" else ()
    for number, parameter in enumerate(declared):
        if parameter.name in of_reading and parameter not in arguments and chosen.random() < 0.75:
            continue  # options of all commands that read robots, of which each tries some
        value = chosen.choice((NAMES, NUMBERS, PAIRS, PLACES)[number % 4])
        if parameter in arguments:
            place = arguments.index(parameter)
            yield [*call[:place], value, *call[place + 1 :]]
        else:
            yield [*call, parameter.opts[0], value, *MORE.get(parameter.opts[0], ())]


OUTPUTS = {"output", "plot", "plot_joints", "poses", "record", "report", "snapshot", "state", "video"}
BY_FORMAT = {("cinegen export", "output"), ("raff2urdf", "output")}
"""Outputs whose ending another option determines."""


def test_every_output_declares_its_endings():
    outputs = {(cmd, parameter.name) for cmd in CALLS for parameter in parameters(cmd) if parameter.name in OUTPUTS}
    rules = {cmd: command_of(cmd).callback.rules for cmd in CALLS}
    assert {(cmd, name) for cmd, name in outputs if not (name in rules[cmd] and rules[cmd][name].endings)} == BY_FORMAT


def test_every_command_is_tried():
    commands = typer.main.get_command(cinegen.cli.app).commands
    assert {f"cinegen {name}" for name in commands} | {"raff2urdf", "urdf2raff"} == set(CALLS)


@pytest.mark.parametrize("command", CALLS)
def test_what_makes_no_sense_is_answered_by_a_sentence(inputs, tmp_path, monkeypatch, capfd, command):
    monkeypatch.setattr(PageOptions, "show", lambda *_: 0)  # values that are right would serve a page
    program, *names = command.split()
    for call in mistaken(command):
        folder = tmp_path / "here"
        shutil.copytree(inputs, folder)
        monkeypatch.chdir(folder)
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO()))
        code = PROGRAMS[program].main([*names, *call])
        out, err = capfd.readouterr()
        assert code in (0, 1, 2), (call, code, err)
        assert "Traceback" not in err, (call, err)
        assert "RuntimeWarning" not in err, (call, err)
        assert code == 0 or err or out, call  # `plan` and `ik` print that there is no answer
        assert code != 2 or f"Try '{program}" in err, (call, err)
        assert len(err.splitlines()) <= 4, (call, err)
        assert (folder / "run.jsonl").read_bytes() == (inputs / "run.jsonl").read_bytes(), call
        monkeypatch.chdir(os.sep)
        shutil.rmtree(folder)
    gc.collect()  # a cluster's client that failed ends its thread when it is collected
