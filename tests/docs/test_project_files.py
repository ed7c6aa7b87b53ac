"""Files that the project works by agree with each other: citation, hooks, targets of make, packages of npm."""

import json
import re
import tomllib

import yaml
from pages import ROOT

from cinegen.cli import app

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_citation_is_of_this_version_and_licence_and_names_the_papers_of_the_sources():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0"
    assert citation["title"] == PROJECT["name"]
    assert str(citation["version"]) == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]
    assert [author["name"].lower() for author in citation["authors"]] == [entry["name"] for entry in PROJECT["authors"]]
    sources = (ROOT / "docs/how-it-works.md").read_text(encoding="utf-8").split("## Sources")[1].split("\n## ")[0]
    named = [" ".join(title.split()) for title in re.findall(r"\*([^*]{20,})\*", sources)]
    assert [reference["title"] for reference in citation["references"]] == named
    for reference in citation["references"]:
        assert all(author["family-names"] in sources for author in reference["authors"]), reference["title"]


def test_packages_of_npm_are_pinned_and_their_lock_names_no_host():
    wanted = json.loads((ROOT / "package.json").read_text(encoding="utf-8"))
    lock = json.loads((ROOT / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    assert "dependencies" not in wanted  # the page itself needs none
    assert lock[""]["devDependencies"] == wanted["devDependencies"]
    for name, version in wanted["devDependencies"].items():
        assert re.fullmatch(r"\d+\.\d+\.\d+", version), name
        assert lock[f"node_modules/{name}"]["version"] == version
    for name, package in lock.items():
        assert "resolved" not in package, name
        assert not name or package["integrity"].startswith("sha512-"), name


def test_the_readme_is_one_screen_and_the_commands_are_listed():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 70
    text = (ROOT / "docs/commands.md").read_text(encoding="utf-8")
    for name in [*(command.name for command in app.registered_commands), "raff2urdf", "urdf2raff"]:
        assert re.search(rf"^\| .*`{name}`.* \|", text, flags=re.MULTILINE), name
