"""Print the pages of the site, without the reference of Python and the sources, as one PDF with an outline.

    python docs/site/pdf.py [FOLDER]

FOLDER is that of `build.py`, which comes first. Needs chromium on PATH.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

ROOT = Path(__file__).parent.parent.parent
LEFT_OUT = "extra,templates,source/**,reference/**,changes.md,contributing.md,security.md"
LINKS_TO_THESE = "misc.highlighting_failure,myst.xref_missing,toc.excluded"
NUMBER = '<p style="width: 100%; text-align: center; font-size: 8px"><span class="pageNumber"></span></p>'
MARGIN = "16mm"


def main() -> int:
    """Write FOLDER/cinegen.pdf; return an exit status."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "build/site").resolve()
    browser = shutil.which("chromium")
    if browser is None or not (folder / "source").is_dir():
        print("pdf.py: no chromium on PATH" if browser is None else f"pdf.py: build.py has not filled {folder}")
        return 1
    settings = (f"suppress_warnings={LINKS_TO_THESE}", f"exclude_patterns={LEFT_OUT}")
    options = [part for setting in settings for part in ("-D", setting)]
    command = [sys.executable, "-m", "sphinx", "-W", "-q", "-b", "singlehtml", *options]
    if subprocess.run([*command, folder / "source", folder / "single"], check=False).returncode:
        return 1
    pdf = folder / "cinegen.pdf"
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        page = chromium.new_page(reduced_motion="reduce")
        page.goto((folder / "single/index.html").as_uri())
        page.pdf(
            path=pdf, format="A4", scale=0.85, outline=True, tagged=True, print_background=True,
            display_header_footer=True, header_template="<p></p>", footer_template=NUMBER,
            margin=dict.fromkeys(("top", "right", "bottom", "left"), MARGIN),
        )  # fmt: skip
        chromium.close()
    print(f"{pdf}: {pdf.stat().st_size / 1e6:.0f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
