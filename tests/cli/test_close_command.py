"""The filter `cinegen close`: values of actuated joints in, values of all joints out."""

import io
import json
import select
import subprocess
import sys

import numpy as np
import pytest
from urdf_text import UrdfJoint, urdf_text

from cinegen.cli import main
from cinegen.model import ForwardKinematics


@pytest.fixture
def filtered(root, monkeypatch, capsys):
    """`filtered(text, "delta4.raff", ...)`: all answers to a text, without a process of its own."""

    def answers(text: str | bytes, file: str, *options: str) -> list[dict]:
        data = text if isinstance(text, bytes) else text.encode()
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
        code = main(["close", str(root / "robots" / file), *options])
        out, err = capsys.readouterr()
        assert (code, err) == (0, "")
        return [json.loads(line) for line in out.splitlines()]

    return answers


def test_each_line_is_answered_by_all_joints_loops_closed(robot, filtered):
    delta = robot("delta4")
    lines = [{"joint1": 0.1, "joint6": -0.2}, {"joint12": 0.05}, {}, {"joint1": 0.1}]
    said = filtered("".join(json.dumps(line) + "\n" for line in lines), "delta4.raff")
    motion = ForwardKinematics(delta)
    assert len(said) == 4
    for line, answer in zip(lines, said, strict=True):
        q = motion.move(line)
        assert tuple(answer) == delta.joints
        assert [answer[joint] for joint in delta.joints] == [q[delta.q_index(joint)] for joint in delta.joints]
        assert delta.closure(delta.configuration(answer)) <= 1e-12
    assert said[3] == said[2] == said[1]
    assert (said[1]["joint1"], said[1]["joint6"], said[1]["joint12"]) == (0.1, -0.2, 0.05)


def test_whoever_writes_a_line_and_waits_is_answered(robot):
    """As a driver does: nothing else is written meanwhile."""
    bar = robot("four_bar")
    command = [sys.executable, "-m", "cinegen", "close", "four_bar"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:

        def is_answered(text: str, seconds: float = 60.0) -> bool:
            process.stdin.write(text)
            process.stdin.flush()
            return bool(select.select([process.stdout], [], [], seconds)[0])

        for i in range(20):
            assert is_answered(json.dumps({"joint1": 0.3 * i}) + "\n")
            answer = json.loads(process.stdout.readline())
            assert answer["joint1"] == 0.3 * i
            assert bar.closure(bar.configuration(answer)) <= 1e-12
        assert not is_answered('{"joint1"', 0.3)  # half a line is no line yet
        assert is_answered(": 0.0}\n")
        assert json.loads(process.stdout.readline())["joint1"] == 0.0
        out, _ = process.communicate('{"joint1": 0.5}', timeout=60)  # the last line may come without its end
        assert json.loads(out)["joint1"] == 0.5
    assert process.returncode == 0


WRONG = (
    ("nonsense", "invalid JSON: expecting value in column 1"),
    ('{"joint1": 0.1', "invalid JSON: "),
    ('{"joint1": 0.1} {}', "invalid JSON: extra data in column 17"),
    ("[0.1]", "not an object"),
    ("0.1", "not an object"),
    ("null", "not an object"),
    ("[" * 100000, "invalid JSON"),
    ('{"joint1": ' + "9" * 5000 + "}", "invalid JSON: "),
    ('{"joint1": 1e999}', "'joint1' is not a finite number: inf"),
    ('{"joint1": [0.1]}', "'joint1' is not a finite number: [0.1]"),
    ('{"jont1": 0.1}', "no joint 'jont1': did you mean 'joint1'?"),
    ('{"joint1": 0.7, "joint2": 0.1}', "joint 'joint2' is passive (actuated: joint1, joint6, joint12)"),
    ('{"joint1": 1e9}', "joint 'joint1' would move from 0.1 to 1e+09 at once: that is too far"),
    ('{"joint1": 3.1}', "joint1 would be at 3.1 rad, beyond its limit 1.39626 rad: nothing moves"),
)


def test_a_line_that_makes_no_sense_is_answered_in_its_place_and_moves_nothing(filtered):
    lines = ['{"joint1": 0.1}']
    for wrong, _ in WRONG:
        lines += [wrong, "{}"]
    said = filtered("\n".join([*lines, "", "   ", '\t{"joint1":0.1}\r']), "delta4.raff")
    assert len(said) == 2 * len(WRONG) + 4
    for i, (_, says) in enumerate(WRONG):
        assert list(said[2 * i + 1]) == ["error"]
        assert says in said[2 * i + 1]["error"]
        assert said[2 * i + 2] == said[0]
    assert said[-1] == said[-2] == said[-3] == said[0]  # blank lines move nothing either


def test_it_goes_on_where_it_was_left(filtered, tmp_path):
    last = filtered('{"joint1": 0.3, "joint6": -0.1}\n', "delta4.raff")[-1]
    (tmp_path / "last.json").write_text(json.dumps(last))
    assert filtered("\n", "delta4.raff", "--start", str(tmp_path / "last.json")) == [last]


def test_limits_are_kept_of_joints_that_follow_too(filtered, tmp_path):
    """The second joint turns twice as far as the first: 0.6 rad are 1.2 there, and its limit is 60 degrees."""
    mimic = '<mimic joint="drive" multiplier="2"/>'
    joints = UrdfJoint("drive", "a", "b"), UrdfJoint("follower", "b", "c", limit=(-1.0, 1.0), more=mimic)
    (tmp_path / "gear.urdf").write_text(urdf_text(joints))
    lines = '{"drive": 0.5}\n{"drive": 0.6}\n{}\n{"drive": 0.1, "drive": 0.2}\n'
    said = filtered(lines, str(tmp_path / "gear.urdf"))
    assert said[0] == said[2] == {"drive": 0.5, "follower": 1.0}
    passed = "follower would pass its limit 1 rad, as it follows, with drive at 0.5 rad (0 % of the motion)"
    assert said[1] == {"error": f"{passed}: nothing moves"}
    assert said[3] == {"error": "invalid JSON: key 'drive' occurs twice in a table"}


def test_degrees_and_millimetres_are_no_radians_and_metres(filtered):
    """Each would be many revolutions, and within the limits in degrees."""
    said = filtered('{"joint1": 30}\n{"joint1": 0.1}\n', "planar_3r.raff")
    assert "did you mean 30 degrees, which are 0.5236 rad? Values are in rad and m" in said[0]["error"]
    assert said[1]["joint1"] == 0.1


def test_bytes_that_are_no_text_are_answered_too(filtered):
    data = b'\xff\xfe\n{"joint1": 0.5}\n\0\n{"j\xc3\xb6int": 1}\n'
    answers = filtered(data, "four_bar.raff")
    assert ["error" in answer for answer in answers] == [True, False, True, True]
    assert "jöint" in answers[3]["error"]


def test_many_lines_at_once(robot, filtered):
    """More than are read at once: those that are read in parts are answered as others."""
    bar, values = robot("four_bar"), (0.05 * np.sin(np.arange(5_000) / 50.0)).tolist()
    said = filtered("".join(f'{{"joint1": {value}}}\n' for value in values), "four_bar.raff")
    assert [answer["joint1"] for answer in said] == values
    assert max(bar.closure(bar.configuration(answer)) for answer in said[::97]) <= 1e-12
