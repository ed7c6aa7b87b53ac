"""Which graphic files can be shown, and where they lie."""

from __future__ import annotations

from pathlib import Path

from raff2urdf.document import Base, Frame, Link, Robot

SHOWN = (".stl", ".obj", ".dae")  # what URDF viewers, Pinocchio and browsers read


def graphics(robot: Robot, part: Base | Link | Frame, beside: Path) -> tuple[list[Path], list[str]]:
    """The node's graphic files that can be shown, and for each of the others why not.

    Args:
        robot: says in `path` where its files lie (`~` is the home folder).
        part: the base, link or frame.
        beside: the RAFF file's folder, from which a relative `path` counts.
    """
    usable, reasons = [], []
    for name in part.filenames:
        try:
            path = beside / Path(robot.path or "").expanduser() / Path(name).expanduser()
            reason = _reason(path)
        except RuntimeError as error:  # "~nobody"
            reason = str(error)
        if reason is None:
            usable.append(path)
        else:
            reasons.append(f"{name} ({reason})")
    return usable, reasons


def _reason(path: Path) -> str | None:
    """Why a file can't be shown; None if it can."""
    try:
        if not path.is_file():
            return "not found"
    except OSError as error:
        return str(error.strerror)
    if path.suffix.lower() not in SHOWN:
        return f"{path.suffix or 'no extension'}: only {', '.join(SHOWN)} can be shown yet"
    import trimesh  # 0.5 s, and only needed where there are graphics

    try:
        empty = trimesh.load(path, force="mesh").is_empty
    except Exception as error:  # every reader has errors of its own
        return f"unreadable: {error}"
    return "holds no surface" if empty else None
