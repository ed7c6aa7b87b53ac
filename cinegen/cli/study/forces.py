"""`cinegen forces`: what the actuated joints must give, and what the joints must bear."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cinegen.cli.files import print_result
from cinegen.cli.numbers import AT, configuration_at, named, quantity
from cinegen.cli.options import FILE, JSON, NODE, RobotOptions, exclude
from cinegen.cli.study.payloads import GRAVITY, PAYLOADS, WRENCHES, carried, gravity_of, wrenches
from cinegen.errors import CinegenError
from raff2urdf.command.command_line import flag, no_effect, option
from raff2urdf.quantities import ACCELERATION, ANGULAR_ACCELERATION, ANGULAR_SPEED, SPEED, Dimension

if TYPE_CHECKING:
    from cinegen.dynamics import Forces, InverseDynamics
    from cinegen.model import Mechanism

_RATE = 250.0  # samples per second of a trajectory
_RATES = "joint1=30,joint2=-5 (deg and m, per second"


def run(
    robots: RobotOptions,
    file: Path = FILE,
    at: str = AT,
    node: str | None = NODE,
    payload: list[str] = PAYLOADS,
    wrench: list[str] = WRENCHES,
    velocity: str = option("JOINTS", f"of actuated joints: {_RATES}); the others follow", ""),
    acceleration: str = option("JOINTS", f"likewise: {_RATES} squared)", ""),
    gravity: str = GRAVITY,
    trajectory: Path | None = option("FILE", "torques along a recorded motion: peak, RMS, power of each joint"),
    reactions: bool = flag("--reactions", "also print what all joints and loops bear"),
    massless: bool = flag("--massless", "links without mass count as having none"),
    json: bool = JSON,
) -> int:
    """Compute what the actuated joints must give, and what the joints must bear.

    Prints torques and forces of the actuated joints that hold the robot, its payload and wrenches, still or in motion.
    Where statics does not determine them, or no torques hold the load, the reason is printed.
    """
    exclude(trajectory=trajectory, at=at)
    exclude(trajectory=trajectory, velocity=velocity)
    exclude(trajectory=trajectory, acceleration=acceleration)
    exclude(trajectory=trajectory, reactions=reactions)
    if trajectory is not None and not payload:
        no_effect("with --trajectory and without --payload", "--node")
    name, mechanism = robots.load_one(file)
    from cinegen.dynamics import InverseDynamics
    from cinegen.dynamics.forces import forces_at

    loads = [*carried(mechanism, payload, node), *wrenches(wrench)]
    dynamics = InverseDynamics(mechanism, loads, gravity_of(gravity), massless)
    shown = [f"  note: {note}" for note in dynamics.notes]
    x, y, z = dynamics.tree.gravity.tolist()
    if (x, y, z) != (0.0, 0.0, -9.81):
        shown.append(f"  gravity: {x:g}, {y:g}, {z:g} m/s2")
    if trajectory is not None:
        report, text = _along(name, dynamics, trajectory, robots.robot)
        print_result(report | {"notes": dynamics.notes}, "\n".join([text, *shown]), json)
        return 0
    v = _rates(mechanism, velocity, "--velocity", ANGULAR_SPEED, SPEED) or None
    a = _rates(mechanism, acceleration, "--acceleration", ANGULAR_ACCELERATION, ACCELERATION) or None
    forces = forces_at(dynamics, configuration_at(mechanism, at, node), v, a, node)
    report = {"name": name, **forces.as_dict()}
    print_result(report, "\n".join([_text(name, forces, reactions), *shown]), json)
    return 0 if forces.is_held else 1


# --- what is typed ----------------------------------------------------------------------------------------------------


def _rates(mechanism: Mechanism, text: str, option: str, turning: Dimension, sliding: Dimension) -> dict[str, float]:
    """Return velocities or accelerations of actuated joints by name, SI units and radians."""
    rates = {}
    for joint, value in named(text, option, "joint1=30").items():
        is_prismatic = joint in mechanism.joints and mechanism.is_prismatic(joint)
        rates[joint] = quantity(value, f"{option}: {joint}", sliding if is_prismatic else turning)
    return rates


# --- what is printed --------------------------------------------------------------------------------------------------


def _text(name: str, forces: Forces, with_reactions: bool) -> str:
    first, *others = forces.message.split("; ")
    lines = [f"{name}: {first}"] if len(first) < 100 else textwrap.wrap(f"{name}: {first}", 110, subsequent_indent="  ")
    lines += [
        line for part in others for line in textwrap.wrap(part, 108, initial_indent="  ", subsequent_indent="    ")
    ]
    if forces.is_held:
        wide = max([8, *map(len, forces.mechanism.actuated)]) + 2
        lines.append("")
        rows = zip(forces.mechanism.actuated, forces.torques, forces.band, forces.used, strict=True)
        for joint, torque, band, used in rows:
            limit = f"   {100.0 * used:.0f} % of its limit" if used else ""
            either = f" ± {_number(band)}" if band else ""
            lines.append(f"  {joint:<{wide}}{_number(torque):>10}{either} {forces.unit_of(joint)}{limit}")
        if forces.v.any():
            lines.append(f"  {'power':<{wide}}{_number(forces.power):>10} W")
    if with_reactions and forces.is_held:
        lines += ["", "  reactions: force (N) and moment (N m) on a body; ? is not determined by statics"]
        for reaction in forces.reactions:
            numbers = "".join(f"{_number(x):>10}" for x in reaction.wrench)
            lines += [f"  {reaction.kind} {reaction.name} on {reaction.body}, {reaction.frame}", f"    {numbers}"]
        for coupling, torques in forces.couplings.items():
            listed = ", ".join(f"{_number(x)} {forces.unit_of(joint)} on {joint}" for joint, x in torques.items())
            lines.append(f"  coupling {coupling}: {listed}")
    return "\n".join(lines)


def _number(value: float) -> str:
    return "?" if value != value else f"{0.0 if abs(value) < 1e-9 else value:.4g}"


def _along(name: str, dynamics: InverseDynamics, file: Path, robot: str | None) -> tuple[Any, str]:
    """Return the report about a recorded motion, and its text."""
    from cinegen.dynamics.trajectory import torques_along
    from cinegen.mission import Recording, resampled

    mechanism = dynamics.mechanism
    recording = Recording.load(file)
    wanted = robot if robot is not None else mechanism.name if mechanism.name in recording.robots else None
    motion = resampled(recording, wanted, rate=_RATE)
    if motion.mechanism.joints != mechanism.joints:
        raise CinegenError(
            f"{file}: joints of '{motion.name}' are not those of {name}: name the file that was driven, or --robot"
        )
    torques = torques_along(dynamics, motion.times, motion.q)
    limits, rows, lines = mechanism.limits, [], []
    for joint, *numbers in zip(
        torques.joints,
        torques.peak,
        torques.peak_time,
        torques.rms,
        torques.peak_power,
        abs(torques.speeds).max(axis=0),
        strict=True,
    ):
        peak, time, mean, power, speed = map(float, numbers)
        unit, per_second = ("N", "m/s") if mechanism.is_prismatic(joint) else ("N m", "rad/s")
        limit = limits[joint].effort
        rows.append({
            "joint": joint, "peak": peak, "at": time, "rms": None if mean != mean else mean, "unit": unit,
            "limit": None if limit == float("inf") else limit, "peak_power": power, "peak_speed": speed,
            "speed_unit": per_second,
        })  # fmt: skip
        part = f", {100.0 * peak / limit:.0f} % of its limit" if limit < float("inf") else ""
        lines.append(
            f"  {joint:<12} peak {_number(peak)} {unit} at {time:.3f} s{part}, RMS {_number(mean)} {unit}, "
            f"at most {_number(power)} W, {_number(speed)} {per_second}"
        )
    lost = torques.not_held
    held = "the actuated joints hold the load" if not len(lost) else (
        f"no torques hold the load at {len(lost)} of {len(torques.times)} samples, first at {lost[0]:.3f} s"
    )  # fmt: skip
    head = f"{name} along {file}, {motion.seconds:.3f} s: {held}"
    report = {
        "name": name, "recording": str(file), "seconds": motion.seconds, "held": not len(lost), "message": held,
        "gravity": dynamics.tree.gravity.tolist(), "torques": rows,
    }  # fmt: skip
    return report, "\n".join([head, "", *lines])
