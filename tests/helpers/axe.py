"""Accessibility of a page that is open in a browser, as axe-core judges it: WCAG 2.2 A and AA, and best practices."""

from pathlib import Path

import pytest

AXE = Path(__file__).resolve().parents[2] / "node_modules" / "axe-core" / "axe.min.js"

needs_axe = pytest.mark.skipif(
    not AXE.is_file(), reason="NO AXE-CORE in node_modules: accessibility is not tested; `make javascript` installs it"
)

# The size of targets is a rule of WCAG 2.2 that axe-core leaves out unless it is asked for.
_RUN = """async (scope) => {
  const { violations } = await axe.run(scope ?? document, { rules: { "target-size": { enabled: true } } });
  return violations.flatMap(({ id, nodes }) => nodes.map(({ target, failureSummary }) =>
    `${id}: ${target.join(" ")}: ${failureSummary.replaceAll(/\\s+/g, " ")}`));
}"""


def violations(page, scope=None):
    """Return the violations that axe-core finds, one text each.

    Args:
        page: page of playwright.
        scope: CSS selector of the part that is looked at; the whole document unless given.
    """
    if not page.evaluate("'axe' in window"):
        page.evaluate(AXE.read_text(encoding="utf-8"))
    return page.evaluate(_RUN, scope)
