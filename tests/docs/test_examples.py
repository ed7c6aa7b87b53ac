"""Every example runs as it stands, from the repository's root, and says something."""

import runpy
import shutil
import sys

import pytest
from pages import ROOT
from variants import slow

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
LONG = {
    *("18_singularities", "19_around_an_obstacle", "20_design_of_a_delta", "21_tolerance_budget_of_a_delta"),
    *("23_bearings_of_a_press", "25_calibrate_a_gough", "27_steps_of_a_delta", "28_five_bar_for_a_rectangle"),
    "29_prove_workspaces",
}


@pytest.mark.parametrize(
    "path",
    [*(path for path in EXAMPLES if path.stem not in LONG), *slow(*(path for path in EXAMPLES if path.stem in LONG))],
    ids=lambda path: path.stem,
)
def test_an_example_runs_and_says_something(path, monkeypatch, capfd):
    """As `python PATH` runs it, without a second for all imports."""
    if "(needs gcc)" in path.read_text(encoding="utf-8") and shutil.which("gcc") is None:
        pytest.skip("there is no gcc")
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", [str(path.relative_to(ROOT))])
    runpy.run_path(sys.argv[0], run_name="__main__")
    out, err = capfd.readouterr()
    assert out.strip()
    assert not err
