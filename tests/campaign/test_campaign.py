"""The campaign finds planted faults and names them; and a slice of it finds none in the package."""

import os
import sys
import time
import warnings
from copy import copy
from random import Random

import numpy as np
import pytest
import typer
from lxml import etree

import cinegen.cli
import raff2urdf.cli
import raff2urdf.urdf2raff.cli
from campaign import messages, mutation, workers
from campaign.kills import WRITERS, Kills
from campaign.readers import READERS, Files, Reader, Seed
from campaign.ticks import Ticks
from cinegen.errors import CinegenError
from raff2urdf.errors import RaffError

TEXT = b'<robot name="r">\n' + b'  <link name="a"/>\n' * 20 + b"</robot>\n"


def reader(read, **more):
    """A reader of one file, which behaves as a test specifies."""
    return Reader("planted", lambda _: [Seed({"r.xml": TEXT}, "r.xml", "r.xml")], read, mutation.XML, **more)


def run_planted(read, tmp_path, cases=300, wall=600.0, **more):
    files = Files(tmp_path, 0, [reader(read, **more)])
    files.limit = 1.0
    return workers.run(files, cases, workers=1, wall=wall)


def causes(read, tmp_path, cases=300, **more):
    return {cause.partition(": ")[0] for cause in run_planted(read, tmp_path, cases, **more).causes}


def with_a_number(path):
    data = path.read_bytes()
    return data if b"1e3" in data else None


def test_a_reader_that_is_right_has_no_findings(tmp_path):
    def read(path):
        if b"link" not in path.read_bytes():
            raise RaffError(f"{path}: has no link: add one")
        return 1

    assert causes(read, tmp_path) == set()


def look_up(path):
    return {}[path]


def warn_and_print(path):
    warnings.warn("overflow", RuntimeWarning, stacklevel=1)
    os.write(2, b"error of a library\n")


def name_nothing(path):
    raise CinegenError("wrong")


def count_links(path):
    """Take only elements that are known, and report nothing of others."""
    return (), 0, 0, [("loop", "ball")] * path.read_bytes().count(b"<link "), 0, (), []


@pytest.mark.parametrize(("read", "cases", "more", "kinds"), [
    (look_up, 3, {}, {"exception"}),
    (name_nothing, 3, {}, {"unnamed file"}),
    (warn_and_print, 3, {}, {"warning", "printed"}),
    (lambda path: np.nan, 3, {"checks": lambda q: [] if np.isfinite(q) else ["not finite"]}, {"invariant"}),
    (lambda path: time.sleep(1000), 1, {"wall": 2.0}, {"abort or deadlock"}),
    (count_links, 300, {"summary": lambda value: value}, {"silent loss"}),
    (lambda path: path.stat().st_size, 300, {"summary": lambda n: ((), 0, 0, [], n)}, {"layout matters"}),
])  # fmt: skip
def test_a_planted_fault_is_found(read, cases, more, kinds, tmp_path):
    assert {f"planted {kind}" for kind in kinds} <= causes(read, tmp_path, cases, **more)


def test_a_hang_a_crash_and_too_much_memory_are_found_and_the_others_go_on(tmp_path):
    def read(path):
        data = path.read_bytes()
        if b"<robot" not in data:
            while True:
                pass
        if b"robot>" not in data:
            os.abort()
        if len(data) > len(TEXT) + 500:
            bytearray(2 * workers.MEMORY)

    result = run_planted(read, tmp_path, 38)
    assert {cause.partition(": ")[0] for cause in result.causes} == {
        "planted hang", "planted abort or deadlock", "planted memory",
    }  # fmt: skip
    assert result.counts["cases"] == 38


def test_a_case_is_made_from_its_number_alone(tmp_path):
    files, other = (Files(tmp_path / name, 7, [reader(with_a_number)]) for name in "ab")
    assert [files.case(i).data for i in range(50)] == [other.case(i).data for i in reversed(range(50))][::-1]
    assert len({files.case(i).data for i in range(50)}) > 40


def test_mutations_of_a_tree_leave_a_tree(root):
    """So they reach what is behind the parser."""
    data = (root / "generated/four_bar.urdf").read_bytes()
    made = {mutation.change_xml(Random(i), data, ("loop", "joint")) for i in range(200)}
    assert len(made) > 150
    for text in made:
        etree.fromstring(text)


@pytest.mark.parametrize(("plant", "kind"), [
    (lambda records, at: records.__setitem__((slice(None), at("record_q").start), np.nan), "not finite"),
    (lambda records, at: records.__setitem__((slice(None), at("record_q")), 50.0), "limit crossed"),
    (lambda records, at: records.__setitem__((slice(None), at("record_v")), 1e9), "too far"),
    (lambda records, at: records.__setitem__((slice(None), 0), 77.0), "status"),
])  # fmt: skip
def test_a_tick_that_breaks_a_promise_is_found(plant, kind):
    campaign = Ticks(0, ("planar_3r",))
    sessions = (campaign._session(Random(f"0/ticks:{i}"), i) for i in range(99))
    session = next(session for session in sessions if session.name == "arm" and session.ticks > 999)
    session.ticks = 300
    session.run()
    _, layout, records = session.records[-1]
    plant(records, lambda name: layout.fields[name][0])
    session.check()
    assert kind in {broken[0] for broken in session.broken}


# --- a slice of the campaign: half a minute of one core --------------------------------------------------------------


def assert_nothing(result):
    assert {key: next(finding for finding in result.findings if finding.key == key) for key in result.causes} == {}


@pytest.fixture(scope="module")
def every_reader(tmp_path_factory):
    """Files of all formats, made once."""
    return Files(tmp_path_factory.mktemp("files"), 0)


@pytest.mark.parametrize("name", READERS)
def test_a_slice_of_the_files(name, every_reader):
    files = copy(every_reader)
    files.readers = (READERS[name],)
    assert_nothing(workers.run(files, 20, workers=1))


def test_a_slice_of_the_ticks():
    result = workers.run(Ticks(), 10, workers=1)
    assert_nothing(result)
    assert result.counts["ticks"] > 20_000


def test_a_slice_of_the_messages():
    result = workers.run(messages.Messages(), 40, workers=1)
    assert_nothing(result)
    assert result.counts["messages"] > 250
    assert result.counts["honest states"] > 10


@pytest.mark.slow
def test_a_slice_of_the_kills(tmp_path):
    result = workers.run(Kills(tmp_path, 1, ("raff2urdf", "map", "drive")), 24, workers=1)
    assert_nothing(result)
    assert result.counts["kills"] == result.counts["full disks"] == 12


def test_every_option_that_names_an_output_is_killed():
    programs = {"cinegen": cinegen.cli, "raff2urdf": raff2urdf.cli, "urdf2raff": raff2urdf.urdf2raff.cli}
    written = set()
    for program, module in programs.items():
        whole = typer.main.get_command(module.app)
        for name, command in getattr(whole, "commands", {"": whole}).items():
            rules = command.callback.rules
            for option in command.params:
                if option.name in ("output", "out") or (option.name in rules and rules[option.name].endings):
                    written.add((f"{program} {name}".strip(), max(option.opts, key=len)))
    calls = [f" {writer.call} " for writer in WRITERS.values()]
    for command, name in written:
        words = "" if name == "out" else f" {name} "  # an argument
        assert any(call.startswith(f" {command} ") and words in call for call in calls), (command, name)


BREAKS = {
    "half a file": "path.write_bytes(content[:9]); path.write_bytes(content)",
    "lost": "path.unlink(missing_ok=True); os.mkdir('x'); os.rmdir('x'); path.write_bytes(content)",
    "end": "try: path.write_bytes(content)\nexcept OSError: raise KeyError",
    "temporary file left": "open('.left', 'wb').close(); path.write_bytes(content)",
    "strange file": "open('other', 'wb').close(); path.write_bytes(content); os.unlink('other')",
}
"""What writes a file so that a kill or a full disk breaks a promise."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", BREAKS)
def test_a_writer_that_breaks_a_promise_is_found(kind, tmp_path, monkeypatch):
    def write_all(contents):
        for path, content in contents.items():
            exec(BREAKS[kind], {"path": path, "content": content, "os": os, "time": time})

    monkeypatch.setattr(sys.modules["cinegen.mission.export"], "write_all", write_all)
    result = workers.run(Kills(tmp_path, 1, ("export",)), 40, workers=1)
    assert kind in {cause.partition(": ")[0].removeprefix("export ") for cause in result.causes}
