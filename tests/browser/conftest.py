"""One chromium, tabs and cockpits for each test."""

from functools import cache
from pathlib import Path

import pytest
from playwright.sync_api import sync_playwright
from repository import module_of
from tabs import CHROMIUM, FLAGS, IN_BROWSER, PICTURES, READY, SIZE, UNDRAWN, becomes

from cinegen.page import build_page
from cinegen.session import Setup


class OneChromium:
    """A chromium for one test after the other, as long as the next one wants it, too: its start takes 3 s of CPU.

    While it runs, this thread has an event loop, and others can't have one of theirs.
    """

    playwright = browser = None

    @classmethod
    def open(cls):
        if cls.browser is None or not cls.browser.is_connected():
            cls.close()
            cls.playwright = sync_playwright().start()
            cls.browser = cls.playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        return cls.browser

    @classmethod
    def close(cls):
        if cls.playwright is not None:
            cls.playwright.stop()
        cls.playwright = cls.browser = None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    for item in items:
        if item.path.parent == Path(__file__).parent:
            for mark in IN_BROWSER:
                item.add_marker(mark)


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(nextitem):
    if "browser" not in getattr(nextitem, "fixturenames", ()):
        OneChromium.close()


@pytest.fixture
def browser():
    return OneChromium.open()


@pytest.fixture
def spare(browser):
    """A page that one test after the other shows something in: half as much work as in a new one."""
    context, *_ = browser.contexts or [browser.new_context(viewport=SIZE)]
    if not context.pages:
        context.new_page().add_init_script("" if PICTURES else UNDRAWN)
    return context.pages[0]


@pytest.fixture
def tab(browser, spare):
    """`tab(shown)`: a page of a cockpit, a file or an address; files are shown with the network off.

    What goes wrong in the page is an error here, and so is what its policy refuses. `strict` false: but for what its
    console says. `drawn` true: its pixels are looked at.
    """
    contexts, spares, heard, wrong = [], [spare], [], []

    def hear(page, event, what):
        page.on(event, what)
        heard.append((page, event, what))

    def open_tab(shown, script="", ready=READY, strict=True, prepare=None, drawn=False, **options):
        address = shown.as_uri() if isinstance(shown, Path) else getattr(shown, "url", shown)
        offline = address.startswith("file:")
        if spares and not (script or prepare or drawn or options):
            page = spares.pop()
            page.context.set_offline(offline)
            page.set_viewport_size(SIZE)
            page.emulate_media(color_scheme="light")
        else:
            contexts.append(browser.new_context(**{"viewport": SIZE, "offline": offline, **options}))
            page = contexts[-1].new_page()
            page.add_init_script(script if drawn or PICTURES else UNDRAWN + script)
        page.set_default_timeout(60_000)
        hear(page, "pageerror", lambda error: wrong.append(str(error)))
        if strict:
            hear(page, "console", lambda message: wrong.append(message.text) if message.type == "error" else None)
        if offline:
            local = ("file:", "data:", "blob:")
            hear(page, "request", lambda sent: None if sent.url.startswith(local) else wrong.append(sent.url))
        if prepare is not None:
            prepare(page)
        page.goto(address)
        assert becomes(page, ready)
        return page

    yield open_tab
    for context in contexts:
        context.close()
    for listener in heard:
        listener[0].remove_listener(*listener[1:])
    if not spares:
        spare.mouse.up()
        spare.evaluate("try { localStorage.clear(); } catch {}")
        spare.context.clear_permissions()
        spare.goto("about:blank")
    assert wrong == []


@pytest.fixture
def opened(cockpit, tab):
    """`session, page = opened("delta4")`: the session of robots, or of a setup, and its page."""

    def open_page(*names, **options):
        session = cockpit(*names, **options)
        return session, tab(session)

    return open_page


@pytest.fixture(scope="session")
def site_builder():
    """The module that builds the site."""
    return module_of("docs/site/build.py")


@pytest.fixture(scope="session")
def page_of(robot, tmp_path_factory):
    """`page_of("rx90")`: the file of a page without a server."""

    @cache
    def build(name):
        path = tmp_path_factory.mktemp("page") / f"{name}.html"
        path.write_text(build_page(Setup({name: robot(name)})))
        return path

    return build
