"""What the pictures of a page are drawn from: the RAFF text above each, and the Python code between; those of how-to
pages from the blocks that `HOWTO` names.

Each picture holds the hash of its source, so that a test finds those that were not drawn again after a change.
"""

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).resolve().parent.parent
PAGES = ("tutorial.md", "joints.md")
HOWTO = {
    "howto_calibrate.png": ("calibrate", "csv measured.csv"),
    "howto_export.png": ("export", "python", "console"),
    "howto_from_cad.webp": ("from-cad", "xml planar.urdf"),
    "howto_linkage.svg": ("linkage", "python"),
    "howto_my_delta.webp": ("my-delta", "raff my_delta.raff"),
    "howto_obstacles.png": ("obstacles", "toml bench.toml"),
    "howto_own_task.png": ("own-task", "python"),
    "howto_urdf_with_loops.webp": ("urdf-with-loops", "xml linkage.urdf"),
}
"""The page of each picture, and the first lines of its blocks; of those alike the first in the page."""
_PART = re.compile(
    r"^```(?P<language>\w+)(?P<words>[^\n]*)\n(?P<text>.*?)^```$|^!\[[^\]]*\]\(pictures/(?P<picture>[\w.]+)\)$",
    flags=re.DOTALL | re.MULTILINE,
)
_HASH = re.compile(rb"source sha256:([0-9a-f]{64})")


@dataclass(frozen=True)
class Source:
    """What a picture is drawn from.

    Attributes:
        picture: its file.
        raff: the last RAFF text above it, with the file's name in the page.
        python: blocks of Python between them.
    """

    picture: str
    raff: str
    python: tuple[str, ...]

    @property
    def mark(self):
        """The hash as pictures hold it."""
        return mark_of([self.raff, *self.python])


def mark_of(texts):
    """Return the hash of texts as pictures hold it."""
    return "source sha256:" + hashlib.sha256("\0".join(texts).encode()).hexdigest()


def howto_blocks(picture):
    """Return the texts that a picture of a how-to page is drawn from."""
    page, *firsts = HOWTO[picture]
    text = (DOCS / "howto" / f"{page}.md").read_text(encoding="utf-8")
    return [re.search(rf"^```{re.escape(first)}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)[1] for first in firsts]


def sources(text):
    """Return the sources of the pictures of a page that stand below a RAFF text, in order."""
    page_sources, raff, python = [], None, []
    for part in _PART.finditer(text):
        if part["picture"] and raff is not None:
            page_sources.append(Source(part["picture"], raff, tuple(python)))
        elif part["language"] == "raff" and not {"wrong", "excerpt"} & set(part["words"].split()):
            raff, python = part["text"], []
        elif part["language"] == "python":
            python.append(part["text"])
    return page_sources


def all_sources():
    """Return the sources of all pages that are drawn like this."""
    return [source for page in PAGES for source in sources((DOCS / page).read_text(encoding="utf-8"))]


def mark_in(picture):
    """Return the hash that the bytes of a picture hold, as `Source.mark` writes it; None if there is none."""
    match = _HASH.search(picture)
    return match and match[0].decode()
