"""Write what campaigns did: `report.json`, its table `report.md`, and the files of each finding."""

import hashlib
import json
import os
import platform
import time
from pathlib import Path
from typing import Any

from campaign.workers import Result
from raff2urdf.version import __version__


def write(folder: Path, what: str, result: Result, command: str) -> None:
    """Add a campaign's result to the report in a folder; replace an earlier one of the same campaign."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "report.json"
    report: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
    cases = {finding.key: finding.case for finding in reversed(result.findings)}
    report[what] = {
        "command": command,
        "version": __version__,
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}",
        "finished": time.strftime("%Y-%m-%d %H:%M:%S"),
        "seconds": round(result.seconds, 1),
        "workers": result.workers,
        "counts": dict(sorted(result.counts.items())),
        "worst": dict(sorted(result.worst.items())),
        "causes": {key: {"number": n, "case": cases[key]} for key, n in result.causes.most_common()},
    }
    path.write_text(json.dumps(report, indent=1, default=str) + "\n")
    (folder / "report.md").write_text(table(report))
    for finding in result.findings:
        name = f"{finding.case.replace(':', '-')}-{hashlib.sha1(finding.key.encode()).hexdigest()[:6]}"
        text = f"{finding.key}\n\n{finding.detail}\n".encode(errors="replace")
        files = {f"{name}/{file}": data for file, data in finding.files.items()}
        for file, data in {f"{name}.txt": text, **files}.items():
            target = folder / "findings" / file
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(data)


def table(report: dict[str, Any]) -> str:
    """Return the report as Markdown."""
    lines = ["| campaign | done | rate a core | worst | causes of findings | command |", "| --- " * 6 + "|"]
    for what, run in report.items():
        unit = "s" if what == "soak" else what if what in run["counts"] else "cases"
        done = run["counts"].get(unit, 0)
        rate = done / max(run["seconds"], 1e-9) / run["workers"]
        worst = "; ".join(f"{name} {shown(value)}" for name, value in run["worst"].items())
        done_in = f"{done:,} {unit} in {run['seconds']:.0f} s"
        lines.append(f"| {what} | {done_in} | {rate:,.0f}/s | {worst} | {len(run['causes'])} | `{run['command']}` |")
    for what, run in report.items():
        lines += ["", f"**{what}**: " + ", ".join(f"{name} {n:,}" for name, n in run["counts"].items())]
        lines += ["", *(f"- {cause['number']:,} x {key} (`{cause['case']}`)" for key, cause in run["causes"].items())]
    return "\n".join(lines) + "\n"


def shown(value: Any) -> str:
    """Return a measured value: a number, or a list that begins with it and goes on with its cause."""
    if isinstance(value, (list, tuple)):
        return f"{shown(value[0])} ({', '.join(map(str, value[1:]))})"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
