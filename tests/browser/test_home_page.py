"""The home page of the site: its weight, its first picture, and the live robot, in a real browser from a server."""

import functools
import http.server
import os
import re
import subprocess
import sys
import threading

import pytest

import cinegen.cli

HEAVIEST = 3_000_000  # bytes, of all that the home page loads
HERO = "hero.webp"
WATCH = """
window.painted = {};
new PerformanceObserver((list) => {
  for (const one of list.getEntries()) if (one.url) painted[one.url.split("/").pop()] = one.startTime;
}).observe({ type: "largest-contentful-paint", buffered: true });
"""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def address(root, site_builder, tmp_path_factory):
    """The home page as Sphinx makes it, without the other pages, on a server."""
    sphinx = root / "build/sphinx"
    if not (sphinx / "sphinx").exists():
        pytest.skip("NO SPHINX: make docs installs it")
    folder = tmp_path_factory.mktemp("home")
    site = site_builder.Site(folder / "source")
    text = (root / "docs/site/index.md").read_text(encoding="utf-8")
    text = re.sub(r"```\{toctree\}.*?```\n", "", text, flags=re.DOTALL)
    site.write("index", re.sub(r"\[([^]]+)\]\([\w./-]+\.md(#[\w-]+)?\)", r"\1", text))
    (folder / "source/extra/live").mkdir(parents=True)
    live = folder / "source/extra/live/delta4.html"
    assert cinegen.cli.main(["page", str(root / "robots/delta4.raff"), "-o", str(live)]) == 0
    command = [sys.executable, "-m", "sphinx", "-W", "-q", folder / "source", folder / "html"]
    subprocess.run(command, check=True, env={**os.environ, "PYTHONPATH": str(sphinx)})
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=folder / "html")
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/index.html"
        server.shutdown()


def test_all_that_is_loaded_is_light_and_the_robot_comes_last(address, tab):
    responses = []

    def watch(page):
        page.on("response", lambda response: responses.append(response))

    page = tab(address, WATCH, f"painted['{HERO}'] !== undefined", prepare=watch)
    live = page.frame_locator("iframe.robot").locator("html[data-view='ready']")
    live.wait_for(state="attached", timeout=180_000)
    asked = page.evaluate("performance.getEntriesByName(document.querySelector('iframe').src)[0].startTime")
    loaded = page.evaluate("performance.getEntriesByType('navigation')[0].loadEventStart")
    sizes = {response.url.rpartition("/")[2]: len(response.body()) for response in responses if response.ok}
    assert {HERO, "delta4.html", "icon.svg", "index.html"} <= set(sizes)
    assert sum(sizes.values()) <= HEAVIEST, sizes
    assert asked > loaded > 0.0
