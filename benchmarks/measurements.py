"""Write the tables of docs/measurements.md again that benchmarks print: `make bench`.

    python benchmarks/measurements.py [WORD...]

A comment above a table, `<!-- measured: python benchmarks/tick.py arm7 | robot, joints, tick -->`, has the command and
the columns that it prints: `group` is the name before the colon of a line above the rows, `name` what a row begins
with. Words choose commands that contain one of them. Where a command fails its table stays, and the exit code is 1.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "measurements.md"
TABLE = re.compile(r"(<!-- measured: (?P<command>[^|]+) \| (?P<columns>[^>]+) -->\n\n(?:\|[^\n]+\n){2})(?:\|[^\n]+\n)*")


def rows(printed: str, columns: list[str]) -> list[list[str]]:
    """Return cells of the rows of a printed table, whose columns end where their headings do."""
    group, ends, table_rows = "", dict[str, int](), list[list[str]]()
    for line in printed.splitlines():
        if {*columns} - {"group", "name"} <= {*line.split()}:
            ends = {match[0]: match.end() for match in re.finditer(r"\S+", line)}
        elif not line.strip():
            ends = {}
        elif not ends:
            group = line.partition(":")[0] if re.match(r"\S[^:]*: ", line) else group
        else:
            cells = {name: line[:end].split()[-1] if line[end - 1 : end].strip() else "" for name, end in ends.items()}
            first = next(cells[name] for name in ends if name in columns)
            cells |= {"group": group, "name": line[: line.index(f" {first}")].strip()}
            table_rows.append([cells[name] for name in columns])
    return table_rows


def main() -> int:
    failed = list[str]()

    def measured(table: re.Match[str]) -> str:
        command, columns = table["command"], table["columns"].split(", ")
        if sys.argv[1:] and not any(word in command for word in sys.argv[1:]):
            return table[0]
        print(f"$ {command}", flush=True)
        words = [sys.executable if word == "python" else word for word in shlex.split(command)]
        done = subprocess.run(words, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
        print(done.stdout, flush=True)
        table_rows = rows(done.stdout, columns)
        if done.returncode or not table_rows:
            failed.append(command)
            return table[0]
        return table[1] + "".join(f"| {' | '.join(cells)} |\n" for cells in table_rows)

    PAGE.write_text(TABLE.sub(measured, PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    for command in failed:
        print(f"*** {command} failed: its table in {PAGE.relative_to(ROOT)} stays", file=sys.stderr)
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
