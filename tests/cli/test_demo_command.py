"""`cinegen demo`, and the names of shipped robots and scenes in other commands, from a folder without any file."""

import pytest

from cinegen.cli import main
from raff2urdf import shipped
from raff2urdf.cli import main as main_of_raff2urdf


@pytest.fixture
def run(capsys, monkeypatch, tmp_path):
    """Runs a command in an empty folder; what it returns, and what it prints on both streams."""
    monkeypatch.chdir(tmp_path)

    def call(*words, command=main):
        code = command(list(words))
        said = capsys.readouterr()
        return code, said.out, said.err

    return call


def test_the_list_has_a_line_for_everything(run, root):
    code, out, _ = run("demo", "--list")
    assert code == 0
    listed = [line.split(maxsplit=1) for line in out.splitlines() if line.startswith("  ")]
    examples = [path.stem[3:] for path in sorted((root / "examples").glob("*.py"))]
    assert [name for name, _ in listed] == [*shipped.robots(), *shipped.scenes(), *examples]
    assert all(20 < len(text) < 125 for _, text in listed)


@pytest.mark.parametrize(("name", "says"), [("two_arms", "right: 4 joints"), ("disc", "clear of 1 obstacle")])
@pytest.mark.usefixtures("session_in_a_thread")
def test_a_robot_or_a_scene_is_driven(run, name, says):
    code, out, err = run("demo", name, "--seconds", "0.2", "--no-browser")
    assert code == 0
    assert says in out
    assert "page: http://127.0.0.1:" in out
    assert "warning" not in err


def test_an_example_is_run(run):
    code, out, _ = run("demo", "kleinfinger")
    assert code == 0
    assert out.strip()


def test_commands_take_the_names_of_robots_and_scenes(run, tmp_path):
    assert run("info", "four_bar")[1].startswith("four_bar: robot 'linkage', mobility 1")
    assert run("plan", "disc", "--json")[0] == 0
    assert run("four_bar", command=main_of_raff2urdf)[0] == 0
    assert (tmp_path / "generated" / "four_bar.urdf").is_file()
    assert run("--check", "delta4", command=main_of_raff2urdf)[1].startswith("delta4: robot 'r1': 17 links")


def test_a_file_comes_before_a_shipped_robot_of_its_name(run, root, tmp_path):
    (tmp_path / "delta4").write_bytes((root / "robots/four_bar.raff").read_bytes())
    assert run("info", "delta4")[1].startswith("delta4: robot 'linkage'")
