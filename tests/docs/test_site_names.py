"""Names in code font lead to the reference where they mean one public thing."""

import importlib.util

import pytest

KINDS = {
    "cinegen.design": "module",
    "cinegen.hexapod.Hexapod": "class",
    "cinegen.ik.Solver": "class",
    "cinegen.ik.Solver.step": "method",
    "cinegen.ik.inverse_kinematics": "function",
    "cinegen.mission.check": "function",
    "cinegen.mission.Recording.load": "method",
    "cinegen.model.load": "function",
    "cinegen.model.Mechanism.close": "method",
    "cinegen.planning.plan": "function",
    "cinegen.session.SetupError": "exception",
    "raff2urdf.check": "function",
    "raff2urdf.load": "function",
}


@pytest.fixture(scope="module")
def entry_of(root):
    spec = importlib.util.spec_from_file_location("site_names", root / "docs/site/names.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return lambda text: module.entry_of(text, KINDS)


@pytest.mark.parametrize(
    ("text", "entry"),
    [
        ("Solver", "cinegen.ik.Solver"),
        ("cinegen.Solver", "cinegen.ik.Solver"),  # imported from the package
        ("cinegen.ik.Solver", "cinegen.ik.Solver"),
        ("Solver.step", "cinegen.ik.Solver.step"),
        ("inverse_kinematics", "cinegen.ik.inverse_kinematics"),
        ("plan(scene, field=f(x))", "cinegen.planning.plan"),
        ("cinegen.design", "cinegen.design"),
        ("cinegen.mission.check", "cinegen.mission.check"),
    ],
)
def test_a_name_leads_to_its_entry(entry_of, text, entry):
    assert entry_of(text) == entry


@pytest.mark.parametrize(
    "text",
    [
        "load(path)",  # of two packages
        "plan",  # a command, too
        "step",  # of some class
        "solver.step()",  # a variable
        "cinegen plan scene.toml",
        "cinegen.Solver(delta).step()",
        "no_such_name",
        "--json",
        "",
    ],
)
def test_other_texts_lead_nowhere(entry_of, text):
    assert entry_of(text) is None
