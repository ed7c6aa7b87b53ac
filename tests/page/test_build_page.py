"""The file of a page without a server: all that it needs is in it, and nothing in it is code but what should be."""

import base64
import json
import re
import shutil
import subprocess
import zlib
from pathlib import Path
from urllib.parse import unquote

import meshcat
import pytest
import umsgpack
from html_elements import Elements

from cinegen.page import build_page, modules
from cinegen.session import Setup

NODE = shutil.which("node")
LARGEST = 600_000
IMPORTED = re.compile(r'(?:^import |\} from |^import \{[^}]*\} from |^ *await import\()"([^"]+)"\)?;', re.MULTILINE)
HOSTILE = "</script><script>alert(1)</script><!--"


@pytest.fixture(scope="module")
def page(robot):
    mechanism = robot("rx90")
    return build_page(Setup({"rx90": mechanism}))


@pytest.fixture(scope="module")
def elements(page):
    return Elements(page)


def unpacked(elements):
    """What the page unpacks."""
    ((_, text),) = [script for script in elements.named("script") if script[0].get("id") == "packed"]
    return json.loads(zlib.decompress(base64.b64decode(text)))


def test_a_robot_with_its_meshes_is_small(page):
    assert len(page.encode()) <= LARGEST


def test_it_refers_to_nothing_outside(elements):
    for tag, attributes, text in elements.found:
        for name in ("src", "href"):
            address = attributes.get(name)
            assert address is None or address.startswith(("#", "data:")) or attributes.get("id") == "page-copy", address
        if tag == "style":
            assert "url(" not in text
            assert "@import" not in text


def test_every_import_is_a_module_of_the_page_and_all_names_are_used(elements):
    addresses = unpacked(elements)["modules"]
    used = {"cinegen/start.js", "cinegen/kernels.js"}
    for name, address in addresses.items():
        kind, _, content = address.partition(",")
        assert kind == "data:text/javascript;charset=utf-8"
        imported = IMPORTED.findall(unquote(content))
        assert set(imported) <= set(addresses), name
        assert len(imported) == len(
            re.findall(r'^(?:import\b|\} from)[^;(]*"[^"]*";|^ *await import\("', unquote(content), re.MULTILINE)
        )
        used |= set(imported)
    assert used == set(addresses)
    assert "cinegen/base/link.js" not in addresses  # the page's own line is there instead
    assert "cinegen/page/session/link.js" in addresses


def test_only_its_own_scripts_may_run(elements):
    ((policy, _),) = [meta for meta in elements.named("meta") if "http-equiv" in meta[0]]
    rules = dict(rule.split(" ", 1) for rule in policy["content"].split("; "))
    assert rules["default-src"] == "'none'"
    nonce = re.fullmatch(r"'nonce-([0-9a-f]{32})'", rules["script-src"])[1]
    kinds = [(attributes.get("nonce"), attributes.get("type")) for attributes, _ in elements.named("script")]
    assert kinds == [(None, "text/plain"), (nonce, None)]


def test_licences_are_whole(page, root):
    spaceless = "".join(page.replace("- -", "--").split())
    viewer = Path(meshcat.__file__).parent / "viewer"
    libraries = json.loads((viewer / "dist" / "main.min.js.THIRD_PARTY_LICENSES.json").read_text())
    texts = [path.read_text() for path in (root / "LICENSE", viewer / "LICENSE")]
    for licence in (*texts, *(library.get("licenseText") or library["license"] for library in libraries)):
        assert "".join(licence.replace("- -", "--").split()) in spaceless


def test_modules_lose_their_comments_and_nothing_else(root):
    acorn = root / "node_modules" / "acorn"
    if NODE is None or not acorn.is_dir():
        pytest.skip("no node, or no node_modules: modules without comments are not compared")
    paths = [
        path.relative_to(root).as_posix()
        for folder in ("cockpit", "page")
        for path in (root / "cinegen" / folder / "static").rglob("*.js")
    ]
    pairs = {path: [(root / path).read_text(), modules.source(path)] for path in paths}
    comment = re.compile(r"^\s*(//.*|\*\s.*|/\*.*\*/|/\*\*?)$", re.MULTILINE)  # on lines of their own
    assert all(comment.search(source) for source, _ in pairs.values())
    assert not any(comment.search(other) for _, other in pairs.values())
    script = root / "tests" / "javascript" / "same_code.js"
    run = subprocess.run([NODE, script], input=json.dumps(pairs), check=True, stdout=subprocess.PIPE, text=True)
    assert json.loads(run.stdout) == []


def test_it_draws_what_the_server_would(elements, robot):
    paths = [umsgpack.unpackb(bytes.fromhex(packed))["path"] for packed in unpacked(elements)["content"]["scene"]]
    nodes = {path.split("/")[4] for path in paths if path.startswith("/meshcat/cinegen/:rx90/")}
    assert nodes
    assert nodes <= {f":{node}" for node in robot("rx90").nodes}
