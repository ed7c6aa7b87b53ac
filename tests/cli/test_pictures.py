"""Pictures of all commands with --plot: PNG, SVG and PDF, which name the robot as its file does, the same each time."""

import shutil
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from cinegen.cli import main
from cinegen.cli.files import write_figure
from cinegen.plotting import sheet

ROOT = Path(__file__).resolve().parents[2]

# What is drawn, and how titles begin.
COMMANDS = {
    "modes": ("modes arm.raff --plot {}", "arm: 2 assembly modes"),
    "plan": ("plan scenes/disc.toml --plot {0} --plot-joints joints-{0}", "planar_3r: ", "planar_3r"),
    "tolerance": ("tolerance arm.raff --sigma link2.d=0.05mm --samples 0 --plot {}", "arm: accuracy of tool"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A robot called arm whose file calls it linkage, and scenes."""
    folder = tmp_path_factory.mktemp("pictures")
    shutil.copy(ROOT / "robots/five_bar.raff", folder / "arm.raff")
    shutil.copy(ROOT / "robots/planar_3r.raff", folder)
    shutil.copytree(ROOT / "robots/scenes", folder / "scenes")
    return folder


@pytest.mark.parametrize("command", COMMANDS)
def test_a_picture_names_the_robot_as_its_file_does(command, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    titles = []
    savefig = Figure.savefig

    def watched(figure, *arguments, **options):
        titles.append(figure.get_suptitle())
        titles.extend(part.get_suptitle() for part in figure.subfigs)
        titles.extend(text.get_text() for text in figure.texts)
        savefig(figure, *arguments, **options)

    monkeypatch.setattr(Figure, "savefig", watched)
    words, *begin = COMMANDS[command]
    assert main(words.format(f"{command}.svg").split()) == 0
    assert all(any(text.startswith(title) for text in titles) for title in begin), titles


def figure():
    drawn, body = sheet.sheet(4.0, 2.0, "arm: a picture", "of a line")
    body.add_subplot().plot([0.0, 1.0], [0.0, 1.0], label="a line")
    sheet.finish(drawn)
    return drawn


def test_each_format_is_written(tmp_path):
    for suffix, begin in (("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")):
        write_figure(tmp_path / f"p.{suffix}", figure(), quiet=True)
        first = (tmp_path / f"p.{suffix}").read_bytes()
        assert first.startswith(begin)
        write_figure(tmp_path / f"p.{suffix}", figure(), quiet=True)
        assert (tmp_path / f"p.{suffix}").read_bytes() == first
    assert b"/TrueType" in first or b"/CIDFontType2" in first
    assert b"/Type3" not in first
