"""Read MJCF, MuJoCo's format, as a URDF and the loops that it closes; MuJoCo itself reads the file.

Bodies become links. Joints keep their variables; several joints of a body are successive ones, and a ball joint becomes
three revolute joints. Equality constraints of the kinds connect and weld become loops; those of the kinds joint and
tendon become couplings, if their tendons are fixed. Equality constraints that are not active are ignored, and so are
limits of tendons. So are connects and welds to mocap bodies, which a user drags: a task does that here.
Joints that actuators drive are actuated. The keyframe `home`, or else the first, is the home configuration. Gravity is
read; so are armature, damping and friction of joints of one degree of freedom, with those of their actuators. Springs,
and what acts on balls and tendons, are not.

Masses are those that MuJoCo computes, from `inertial` or from geoms, as the compiler settings are; also from meshes, if
their files are there. A body whose mass they are needed for has none without them.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Collection, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from raff2urdf.command.extras import needs
from raff2urdf.errors import Problem, RaffError, did_you_mean, warn
from raff2urdf.quantities import typed_in_radians
from raff2urdf.readers.loops.declaration import leave_out
from raff2urdf.readers.mjcf_conversion import MjcfConversion
from raff2urdf.readers.mjcf_faults import FaultyMjcf
from raff2urdf.readers.mjcf_files import read_files
from raff2urdf.readers.mjcf_masses import masses_of, remove_meshes, weighing_meshes
from raff2urdf.readers.urdf import LARGEST
from raff2urdf.readers.urdf_builder import Converted


def read(path: Path, ignore: Collection[str] = (), text: str | None = None) -> Converted:
    """Read an MJCF.

    Meshes are not read, only named, unless the mass of a body depends on them; they may be missing.

    Args:
        path: of the file.
        ignore: names of equality constraints, or of flexes with all their equality constraints, to be left out.
        text: of an MJCF that is no file; the path is only a name then.

    Raises:
        RaffError: MuJoCo can't read it, for the reasons that it gives: all that can be found; or equality constraints
            have no counterpart.
        MissingExtraError: MuJoCo is not installed.
    """
    with needs("mjcf", f"{path}: MJCF files"):
        import mujoco
    roots, problems = read_files(path, text)
    if problems:
        why = ""
    else:
        try:
            return _read(mujoco, path, ignore, text)
        except _MujocoError as error:
            why = str(error)
    raise RaffError([*problems, *_problems(mujoco, path, ignore, roots, why)])


class _MujocoError(Exception):
    """The reason for which MuJoCo can't read a file, in one line."""


_MOST = 100
"""Problems that are looked for."""


def _problems(
    mujoco: Any, path: Path, ignore: Collection[str], roots: Mapping[Path, Any], why: str
) -> Iterator[Problem]:
    """Yield the problems of files for which MuJoCo can't read the first, in the order of their lines.

    Args:
        mujoco: the package.
        path: of the first file.
        ignore: as for `read`.
        roots: first elements of the files, by their paths.
        why: the reason that MuJoCo gives first, if it was asked.
    """
    files = [*map(str, roots)]
    faulty, problems = FaultyMjcf(path, roots), list[tuple[int, float, Problem]]()
    names = deepcopy(faulty.root)

    def say(why: str, file: str = str(path), line: int = 0) -> None:
        place = f"{file}:{line}" if line else file
        said = Problem(f"{place}: MuJoCo can't read it: {why}{_remedy(why, names)}")
        problems.append((files.index(file), line or math.inf, said))

    for missing in faulty.not_included:
        say(*missing)
    for model, file in faulty.attached():
        if file.suffix.lower() != ".urdf" and (said := _problems_of(mujoco, file)):
            problems += [(files.index(str(file)), math.inf, problem) for problem in said]
            faulty.leave_out_model(model, roots[file].get("model"))
    for _ in range(_MOST):
        try:
            _read(mujoco, path, ignore, faulty.text())
            break
        except _MujocoError as error:
            fault = faulty.leave_out(str(error))
            if fault is None:
                say(re.sub(r",? ?(Element '[^']*', )?line \d+$", "", str(error)))
                break
            if fault[0]:
                say(*fault)
        except RaffError as error:  # what MuJoCo reads, but has no counterpart
            problems += [(0, math.inf, problem) for problem in error.problems]
            break
    if why and not problems:
        say(why)
    return (problem for _, _, problem in sorted(problems, key=itemgetter(0, 1)))


def _problems_of(mujoco: Any, path: Path) -> list[Problem]:
    """Return the problems for which MuJoCo can't read a file that another one attaches."""
    try:
        _read(mujoco, path, (), None)
    except _MujocoError as error:
        return list(_problems(mujoco, path, (), read_files(path, None)[0], str(error)))
    except RaffError:  # it is told of the whole
        pass
    return []


def _read(mujoco: Any, path: Path, ignore: Collection[str], text: str | None) -> Converted:
    """Read as `read` does.

    Raises:
        _MujocoError: MuJoCo can't read it.
        RaffError: equality constraints have no counterpart, or numbers can't be meant.
    """
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)  # its warnings concern simulation; it would write them to a file
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # likewise
            # After some errors MuJoCo 4.0 keeps a handler of warnings that calls itself for ever, one for each thread:
            # hence a new thread.
            with ThreadPoolExecutor(1) as thread:
                read = mujoco.MjSpec.from_file if text is None else mujoco.MjSpec.from_string
                spec = thread.submit(read, str(path) if text is None else text).result()
            soft = _remove_flexes(spec, str(path), ignore)
            needed, unknown = weighing_meshes(mujoco, spec, path)
            weighing = spec.copy() if needed else spec
            meshes = remove_meshes(mujoco, spec)
            weights = model = spec.compile()
            if needed:
                remove_meshes(mujoco, weighing, needed)
                try:
                    weights = weighing.compile()
                except (ValueError, OSError, RuntimeError) as error:
                    why = f"MuJoCo can't read its meshes: {' '.join(str(error).split())}"
                    unknown, weighing = dict.fromkeys(needed.values(), why) | unknown, spec
            if unknown and spec.compiler.settotalmass > 0.0:
                unknown = (
                    dict.fromkeys(range(1, len(spec.bodies)), "settotalmass needs the masses of all bodies") | unknown
                )
    except (ValueError, OSError, RuntimeError) as error:
        raise _MujocoError(" ".join(str(error).split())) from None
    finally:
        mujoco.set_mju_user_warning(before)
    _warn_of_radians(spec, str(path))
    placed = {"body": model.body_pos, "joint": model.jnt_pos, "equality": model.eq_data, "keyframe": model.key_qpos}
    placed |= {"gravity": model.opt.gravity, "joint's friction": np.stack([model.dof_damping, model.dof_frictionloss])}
    placed |= {"armature": model.dof_armature, "actuator": np.stack([model.actuator_armature, model.actuator_damping])}
    placed |= {"site": model.site_pos, "geom": model.geom_pos, "joint's ref": model.qpos0, "tendon": model.wrap_prm}
    wrong = [
        f"a number of a {what} is beyond {LARGEST:g}: check its unit (m, rad)"
        for what, numbers in placed.items()
        if not np.abs(numbers).max(initial=0.0) <= LARGEST
    ]
    turned = {"body": model.body_quat, "site": model.site_quat, "geom": model.geom_quat, "joint": model.jnt_axis}
    wrong += [
        f"the orientation of a {what} is not a rotation: its numbers are 0 or too large"
        for what, vectors in turned.items()
        if not np.abs(np.linalg.norm(vectors, axis=1) - 1.0).max(initial=0.0) <= 1e-6
    ]
    reader = MjcfConversion(mujoco, model, spec.modelname or path.stem, meshes, str(path))
    masses = masses_of(weights, weighing, unknown)
    wrong += [
        f"the inertia of body '{reader.bodies[body]}' is beyond {LARGEST:g}: check its unit (kg, m)"
        for body, inertia in masses.items()
        if not inertia.largest <= LARGEST
    ]
    if wrong:
        raise RaffError(Problem(f"{path}: {what}") for what in wrong)
    urdf, constraints = reader.read(ignore, masses)
    left_out = [f"inertia of body '{reader.bodies[spec.bodies[body].id]}': {why}" for body, why in unknown.items()]
    return Converted(urdf, constraints, [*soft, *reader.ignored, *left_out], reader.notes)


def _remedy(why: str, root: Any) -> str:
    """Return the edit that an error of MuJoCo asks for, to be appended to it; empty where none is known."""
    if "range[0] should be smaller than range[1]" in why:
        return ": swap them"
    if "axis too small" in why:
        return ': write its direction, such as axis="0 0 1"'
    match = re.search("(unknown|invalid|not found|missing)[^']*'([^']*)'", why)
    if match is None:
        return ""
    word = match[2]
    if "keyword" in why:
        return (
            ""
            if "Element 'joint'" not in why
            else did_you_mean(_TYPES.get(word, word), ("hinge", "slide", "ball", "free"))
        )
    if "default class" in why:
        near = did_you_mean(word, [str(e.get("class")) for e in root.iter("default") if e.get("class")])
        return near if near.endswith("?") else f'{near}: add <default class="{word}"/> to <default>'
    return did_you_mean(word, [str(e.get("name")) for e in root.iter("*") if e.get("name")])


_TYPES = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide", "spherical": "ball", "floating": "free"}
"""Types of joints by the words of other formats."""


def _warn_of_radians(spec: Any, name: str) -> None:
    """Warn of a range in degrees that is a range of whole multiples of five degrees if it is in radians."""
    for joint in spec.joints if spec.compiler.degree else ():
        degrees = typed_in_radians(joint.range)
        if degrees is not None:
            low, high = joint.range
            edit = f'write range="{degrees[0]:g} {degrees[1]:g}", or angle="radian" in <compiler>'
            warn(
                f"{name}: the range of joint '{joint.name}' is {low:g} to {high:g} degrees: if it is in radians, {edit}"
            )
            return


def _remove_flexes(spec: Any, name: str, ignore: Collection[str]) -> list[str]:
    """Remove all flexes and their equality constraints; return these.

    Raises:
        RaffError: one of these is active, and neither it nor its flex is in `ignore`.
    """
    removed, wrong = list[str](), list[Problem]()
    flexes = {flex.name for flex in spec.flexes}
    for equality in list(spec.equalities):
        (flex,) = flexes & {equality.name1, equality.name2} or {None}
        if flex is None:
            continue
        label = equality.name or flex
        if equality.active and not {label, flex} & set(ignore):
            why = f"constrains the flex '{flex}', and only rigid bodies are read"
            wrong.append(Problem(f"{name}: the equality constraint '{label}' {why}: {leave_out(label)}"))
        removed.append(f"equality constraint '{label}'{'' if equality.active else ' (not active)'}")
        spec.delete(equality)
    if wrong:
        raise RaffError(wrong)
    for flex in list(spec.flexes):
        spec.delete(flex)
    return removed
