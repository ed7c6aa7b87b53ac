"""Pictures of all commands with --plot: PNG, SVG and PDF, which name the robot as its file does, the same each time."""

from cinegen.cli.files import write_figure
from cinegen.plotting import sheet


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
