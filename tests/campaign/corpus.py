"""The corpus: files of every format that must be read, and every file that ever broke a promise, with what must happen.

`corpus/<reader>/<status>-<cause>`, a file, or a folder of files that are read together: `read`, or `refused` with an
error of the package. Those that are read are also what the campaign mutates.
"""

from pathlib import Path
from typing import NamedTuple

CORPUS = Path(__file__).with_name("corpus")

_MAIN = (".urdf", ".json", ".toml")  # of the files of a folder, the first of these is read


class Seed(NamedTuple):
    """Files that are read together.

    Attributes:
        files: their contents by name; None of a link that leads nowhere.
        subject: the file that is mutated.
        main: the file that is read.
    """

    files: dict[str, bytes]
    subject: str
    main: str


def entries(reader: str = "*", status: str = "*") -> list[Path]:
    """Return the entries of a reader, or of all, with a status, or any."""
    return sorted(CORPUS.glob(f"{reader}/{status}-*"))


def seed_of(entry: Path) -> Seed:
    """Return the files of an entry."""
    if not entry.is_dir():
        return Seed({entry.name: entry.read_bytes()}, entry.name, entry.name)
    paths = sorted(entry.iterdir(), key=lambda path: [path.suffix == ending for ending in _MAIN], reverse=True)
    files = {path.name: path.read_bytes() for path in paths if path.exists()}
    main, *others = files
    return Seed(files, main if entry.parent.name in ("urdf", "scene") else others[0], main)
