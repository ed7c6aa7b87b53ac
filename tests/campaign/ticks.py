"""Adversarial ticks: a solver is given tasks that nobody would give it. It must close its loops, keep all limits,
report a status, and never raise.

A case is a session of some thousand ticks of one robot: targets far away, NaN or infinite, sudden jumps, weights and
gains of any size, tasks that come and go, objectives that raise, narrow limits, obstacles. What must hold of a tick is
checked afterwards, of all ticks at once, and of some by Pinocchio.
"""

from __future__ import annotations

import math
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pinocchio as pin

import cinegen
from campaign.judge import Finding, where
from campaign.readers import ROOT
from campaign.workers import Campaign
from cinegen.errors import CinegenError
from cinegen.ik import Solver, objectives
from cinegen.ik._kernels import memory as m
from cinegen.ik.thresholds import STEP_CAP
from cinegen.tolerances import AT_LIMIT, CLOSURE
from raff2urdf.errors import RaffError

TICKS = 4000
"""Ticks of a session."""

GUARDED_TICKS = 300
"""Ticks of a session among obstacles."""

_EVERY = 40  # ticks between two interventions, on average
_SAMPLED = 97  # ticks between two that Pinocchio checks
_ROUNDING = 1e-9
_SCENES = ("disc", "discs", "rod")

Array = np.ndarray


class Ticks(Campaign):
    """Sessions of random robots of the repository, and of random mechanisms.

    Args:
        seed: of the campaign.
        robots: names of the robots; all of the repository unless given.
    """

    name = "ticks"

    def __init__(self, seed: int = 0, robots: tuple[str, ...] = ()) -> None:
        self.seed = seed
        paths = sorted((ROOT / "robots").glob("*.raff"))
        self._robots = {path.stem: path for path in paths if not robots or path.stem in robots}
        self._loaded: dict[str, cinegen.Mechanism] = {}
        self._folder = Path(tempfile.mkdtemp(prefix="ticks"))
        _wait_for_kernels()

    def run(self, number: int) -> tuple[dict[str, int], dict[str, Any], list[Finding]]:
        """Run a session; return what is counted, what is measured, and the findings."""
        case, rng = f"ticks:{number}", Random(f"{self.seed}/ticks:{number}")
        try:
            session = self._session(rng, number)
        except (RaffError, CinegenError):  # a random mechanism that can't be closed, as `files` tests
            return {"cases": 1, "unloadable": 1}, {}, []
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            warnings.simplefilter("ignore", ResourceWarning)  # of what others left to the garbage collector
            session.run()
        session.check()
        for warning in warned:
            place = f"{warning.category.__name__} of {'/'.join(Path(warning.filename).parts[-2:])}:{warning.lineno}"
            session.broken.append(("warning", place, str(warning.message)))
        findings = [Finding(case, *fault) for fault in dict.fromkeys(session.broken)]
        worst = {name: [*value, session.name, case] for name, value in session.worst.items()}
        return {"cases": 1, **session.counts}, worst, findings

    def _session(self, rng: Random, number: int) -> Session:
        kind = rng.random()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if kind < 0.03:
                free = rng.choice((None, math.inf))
                session = Session(_among_obstacles(rng, free), rng, GUARDED_TICKS)
                session.brakes = free is None
                return session
            name = rng.choice(list(self._robots))
            if kind < 0.6:
                if name not in self._loaded:
                    self._loaded[name] = cinegen.load(self._robots[name])
                mechanism = self._loaded[name]
            else:
                text = self._robots[name].read_text() if kind < 0.85 else _random_text(rng)
                path = self._folder / f"{name if kind < 0.85 else 'random'}.raff"
                path.write_text(_with_limits(rng, text))
                mechanism = cinegen.load(path)
            gain = math.inf if rng.random() < 0.5 else 10 ** rng.uniform(-2, 6)
            dt = rng.choice((1e-3, 1e-3, 1e-2, 1 / 60, 1e-6, 0.5))
            acceleration = 10 ** rng.uniform(-2, 4) if rng.random() < 0.15 else None
            session = Session(Solver(mechanism, dt, gain=gain, acceleration=acceleration), rng, TICKS)
            session.brakes = acceleration is not None
            return session


def _wait_for_kernels() -> None:
    solver = Solver(cinegen.load(ROOT / "robots/five_bar.raff"), 1e-3)
    end = time.monotonic() + 300.0
    while not solver.is_compiled and time.monotonic() < end:
        solver.step()
        time.sleep(0.05)


def _random_text(rng: Random) -> str:
    """Return a random mechanism with loops."""
    from making import graph

    bodies = rng.randint(2, 8)
    made = graph(np.random.default_rng(rng.randrange(2**32)), bodies, rng.randint(0, min(3, bodies - 1)))
    return f"RAFF random\n{made.text()}"


def _with_limits(rng: Random, text: str) -> str:
    """Give links random limits: narrow, wide, of one point, and speeds."""
    parts = text.split(" pred ")
    for i in range(1, len(parts)):
        if "type" in parts[i - 1][-40:] and rng.random() < 0.6 and "limits" not in parts[i].split("link")[0]:
            low = rng.choice((0.0, 1e-6, 1.0, 30.0, 400.0))
            number, space, rest = parts[i].partition(" ")
            is_free = rng.random() < 0.5 and "velocity" not in rest.split("link")[0]
            speed = f"velocity {10 ** rng.uniform(-3, 4):g} " if is_free else ""
            parts[i] = f"{number}{space}limits {{ {-low:g} {low * rng.choice((0.0, 1.0, 2.0)):g} }} {speed}{rest}"
    return " pred ".join(parts)


def _among_obstacles(rng: Random, acceleration: float | None) -> Solver:
    from cinegen.collision import clearance_of
    from cinegen.collision.scene_file import load_scene
    from cinegen.planning.safe_drag import AvoidingSolver

    scene = load_scene(ROOT / f"robots/scenes/{rng.choice(_SCENES)}.toml")
    dt = rng.choice((1e-3, 1e-2))
    return AvoidingSolver(clearance_of(scene), dt, scene.safety, q=scene.start, acceleration=acceleration)


class _Raises:
    """An objective that fails in some way."""

    def __init__(self, how: str) -> None:
        self.how = how

    def velocity(self, state: Any) -> Any:
        """Fail."""
        if self.how == "raise":
            raise KeyError("x")
        wrong = {"nan": np.full(len(state.q), np.nan), "shape": np.zeros(3)}
        return wrong.get(self.how, np.full(state.mechanism.model.nv, 1e200))


class Session:
    """Ticks of a solver, each recorded, with interventions between them.

    Attributes:
        counts: of ticks and of statuses.
        worst: what was measured.
        broken: kind, where and detail of each broken promise.
    """

    def __init__(self, solver: Solver, rng: Random, ticks: int) -> None:
        self.solver, self.rng, self.ticks = solver, rng, ticks
        self.mechanism = mechanism = solver.mechanism
        self.name = Path(mechanism.name).stem
        self.is_guarded = ticks == GUARDED_TICKS
        self.counts: dict[str, int] = {"ticks": 0}
        self.worst: dict[str, list[Any]] = {}
        self.broken: list[tuple[str, str, str]] = []
        limits = mechanism.limits
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            seed = rng.randrange(1000)
            self.known = [q for q in mechanism.random_closed(4, seed) if not limits.exceeded(q)] or [mechanism.q_home]
        self.records: list[tuple[int, Any, Array]] = []  # of each run: its first tick, its layout, its records
        self.jumps: set[int] = set()  # ticks before which the configuration was set
        self.last_action = "begin"
        self.brakes = False
        self._begun = [solver.q]

    def run(self) -> None:
        """Run all ticks."""
        solver, rng = self.solver, self.rng
        following, layout, rows, first = 0, None, [], 0
        for tick in range(self.ticks):
            if tick >= following:
                following = tick + 1 + int(rng.expovariate(1.0 / _EVERY))
                self._intervene(tick)
            try:
                step = solver.step()
            except Exception as error:
                self._raised(f"after {self.last_action}", error)
                break
            if step._layout is not layout:
                if rows:
                    self.records.append((first, layout, np.array(rows)))
                layout, rows, first = step._layout, [], tick
            rows.append(step._record)
            self.counts["ticks"] += 1
        if rows:
            self.records.append((first, layout, np.array(rows)))

    def _break(self, kind: str, place: str, detail: str) -> None:
        self.broken.append((kind, place, f"{self.name}, dt {self.solver.dt}, gain {self.solver.gain}: {detail}"))

    def _raised(self, when: str, error: Exception) -> None:
        self._break("exception", where(error), f"{when}: {''.join(traceback.format_exception(error))}")

    # --- interventions -------------------------------------------------------------------------------------------

    def _intervene(self, tick: int) -> None:
        """Do something to the solver; what it refuses by an error of the package is no matter."""
        action = self.rng.choice(self._actions)
        self.last_action = action.__name__.strip("_").replace("_", " ")
        try:
            action(self, tick)
        except CinegenError:
            self.counts["refused"] = self.counts.get("refused", 0) + 1
        except Exception as error:
            self._raised(f"in {self.last_action}", error)

    def _pose(self) -> pin.SE3:
        """Return a target: near, reachable, far away, singular (stretched), NaN or infinite."""
        rng, mechanism = self.rng, self.mechanism
        node = rng.choice(mechanism.nodes)
        pose = mechanism.placement(rng.choice(self.known), node)
        kind = rng.randrange(16)
        if kind < 6:
            return pose
        if kind < 13:
            far = mechanism.length * 10 ** rng.uniform(-9, rng.choice((0, 1, 12, 300)))
            away = np.array([rng.gauss(0, 1) for _ in range(3)])
            with np.errstate(over="ignore"):
                turn = pin.exp3(np.array([rng.gauss(0, 2) for _ in range(3)]))
                return pin.SE3(pose.rotation @ turn, pose.translation + far * away)
        matrix = pose.homogeneous.copy()
        if kind == 13:
            matrix[rng.randrange(3), rng.randrange(4)] = rng.choice((math.nan, math.inf, -math.inf, 1e308))
        elif kind == 14:
            matrix[:3, :3] *= rng.choice((0.0, -1.0, 1.0 + 1e-6, 1e3))
        return pin.SE3(matrix)

    def _task(self) -> Any:
        return self.rng.choice(self.solver.tasks) if self.solver.tasks else self._add(0)

    def _add(self, _: int) -> Any:
        rng, solver = self.rng, self.solver
        if len(solver.tasks) > 6:
            solver.remove_task(rng.choice(solver.tasks))
        offset = np.array([rng.gauss(0, 1) for _ in range(3)]) * rng.choice((0.0, 0.1, 1e6))
        nodes = self.mechanism.nodes
        target, offset = self._pose() if rng.random() < 0.7 else None, offset if rng.random() < 0.3 else None
        axes = rng.choice(("target", "world", rng.choice(nodes)))
        counts = rng.randint(0, 3), rng.randint(0, 3)
        return solver.add_task(rng.choice(nodes), target, *counts, 10 ** rng.uniform(-12, 12), axes, offset)

    def _remove(self, _: int) -> None:
        if self.solver.tasks:
            self.solver.remove_task(self.rng.choice(self.solver.tasks), self.rng.choice((0.0, 0.0, 0.1)))

    def _retarget(self, _: int) -> None:
        self._task().target = self._pose()

    def _change_in_place(self, _: int) -> None:
        target = self._task().target
        if isinstance(target, np.ndarray):  # a twist that was refused
            return
        target.translation = target.translation + self.rng.choice((1e-3, 1.0, 1e9, math.nan)) * np.ones(3)

    def _twist(self, _: int) -> None:
        size = self.rng.choice((0.0, 1e-3, 1.0, 1e6, 1e300, math.nan, math.inf))
        with np.errstate(invalid="ignore"):
            self._task().twist = size * np.array([self.rng.gauss(0, 1) for _ in range(6)])

    def _reweigh(self, _: int) -> None:
        some = (0.0, 1.0, 1e-300, 1e300, -1.0, math.nan, math.inf, 10 ** self.rng.uniform(-6, 6))
        self._task().weight = self.rng.choice(some)

    def _reweigh_axes(self, _: int) -> None:
        self._task().weights = [self.rng.choice((0.0, 0.0, 1.0, 1e-9, 1e12, math.nan)) for _ in range(6)]

    def _count(self, _: int) -> None:
        which, count = self.rng.choice(("translation", "rotation")), self.rng.choice((0, 1, 2, 3, 3, 4, -1, 1.5, "x"))
        setattr(self._task(), which, count)

    def _gain(self, _: int) -> None:
        self.solver.gain = self.rng.choice((math.inf, 1e-300, 1e300, 1.0, 100.0, 0.0, math.nan))

    def _damp(self, _: int) -> None:
        self.solver.damping_threshold = self.rng.choice((1e-12, 1e-3, 0.05, 1.0, 0.0, math.nan))

    def _jump(self, tick: int) -> None:
        if not self.is_guarded:
            self.solver.q = self.rng.choice(self.known)
            self.jumps.add(tick)
            self._begun.append(self.solver.q)

    def _stretch(self, _: int) -> None:
        """Pull the end straight away: to a singular configuration, or a limit."""
        home = self.mechanism.placement(self.solver.q, self.mechanism.end)
        for task in self.solver.tasks:
            self.solver.remove_task(task)
        self.solver.add_task(self.mechanism.end, pin.SE3(home.rotation, home.translation * 1e3), 3, 0)

    def _aim(self, _: int) -> None:
        rng = self.rng
        candidates = [objectives.Posture(rate=10 ** rng.uniform(-3, 6)),
                      objectives.LimitMargin(rate=10 ** rng.uniform(-3, 6)), objectives.Manipulability(),
                      *(_Raises(how) for how in ("raise", "nan", "shape", "huge"))]  # fmt: skip
        self.solver.objectives = rng.sample(candidates, rng.randint(0, 2)) if rng.random() < 0.4 else []

    def _blend(self, _: int) -> None:
        seconds, speed = self.rng.choice((0.0, 0.05, 1e9)), self.rng.choice((None, 0.0, 1.0, 1e300))
        self.solver.blend(self._task(), self._pose(), seconds, speed)

    def _calm(self, tick: int) -> None:
        """Ask for the pose in which it is: that is followed at once, whatever was before, unless it has to brake."""
        solver = self.solver
        if self.brakes:
            return
        for task in solver.tasks:
            solver.remove_task(task)
        solver.objectives, solver.gain = [], math.inf
        solver.add_task(self.mechanism.end)
        step = solver.step()
        self.jumps.add(tick)  # this tick is not recorded
        if step.status.name not in ("FOLLOWING", "DETOUR", "BARRED"):
            self._break("not calm", step.status.name, "though the task is the present pose")

    _actions: tuple[Callable[[Session, int], Any], ...] = (
        _add, _add, _remove, _retarget, _retarget, _retarget, _retarget, _change_in_place, _twist, _reweigh,
        _reweigh_axes, _count, _gain, _damp, _jump, _stretch, _stretch, _aim, _blend, _calm,
    )  # fmt: skip

    # --- what must hold ------------------------------------------------------------------------------------------

    def check(self) -> None:
        """Check all ticks."""
        for first, layout, records in self.records:
            for kind, ticks, detail in self._wrong(first, layout, records):
                self._break(kind, "", f"tick {ticks[0]} and {len(ticks) - 1} more of {len(records)}: {detail}")

    def _wrong(self, first: int, layout: Any, records: Array) -> Iterator[tuple[str, Array, str]]:
        mechanism, dt = self.mechanism, self.solver.dt
        q, v = (records[:, layout.fields[name][0]] for name in ("record_q", "record_v"))
        closure, status = records[:, m.CLOSURE], records[:, m.STATUS]
        for number, count in zip(*np.unique(status, return_counts=True), strict=True):
            word = f"status {int(number)}"
            self.counts[word] = self.counts.get(word, 0) + int(count)
        finite = np.isfinite(q).all(axis=1) & np.isfinite(v).all(axis=1)
        lower = np.min([mechanism.limits.lower, *self._begun], axis=0)
        upper = np.max([mechanism.limits.upper, *self._begun], axis=0)
        beyond = np.maximum(lower - q, q - upper).max(axis=1)
        speeds = mechanism.model.upperVelocityLimit
        faster = (np.abs(v) > speeds * (1.0 + _ROUNDING) + 1e-300).any(axis=1)
        steps = (np.abs(v) * dt / mechanism.scale).max(axis=1)
        for kind, broken, detail in (
            ("not finite", ~finite, "q or v"),
            ("status", (status < 0) | (status > 8) | (status % 1 != 0), "unknown"),
            ("open loops", ~(closure <= CLOSURE), f"closure {closure.max()}"),
            ("limit crossed", beyond > AT_LIMIT, f"by {beyond.max()}"),
            ("too fast", faster, f"by a factor of {(np.abs(v) / speeds).max()}"),
            ("too far", steps > STEP_CAP * (1.0 + 1e-6), f"{steps.max()} in one tick"),
        ):
            if broken.any():
                yield kind, first + np.flatnonzero(broken), detail
        sampled = range((-first) % _SAMPLED, len(q), _SAMPLED)
        exact = np.array([mechanism.closure(q[i]) for i in sampled if finite[i]])
        if not (exact <= 2.0 * CLOSURE).all():
            yield "open loops", np.array([first]), f"closure by Pinocchio {exact.max()}"
        for name, values in (("closure", closure), ("closure by Pinocchio", exact), ("beyond a limit", beyond)):
            if len(values):
                self.worst[name] = max(self.worst.get(name, [-math.inf]), [float(np.max(values))])
        if mechanism.model.nq == mechanism.model.nv and len(q) > 1:
            ticks = first + 1 + np.arange(len(q) - 1)
            free = ~np.isin(ticks, [*self.jumps])
            moved = np.abs(np.diff(q, axis=0) - v[1:] * dt).max(axis=1) > _ROUNDING * (1.0 + np.abs(q[1:]).max(axis=1))
            if (moved & free).any():
                yield "v is not how q moved", ticks[moved & free], ""
        if self.is_guarded:
            least = [self.solver.clearance.least(q[i]) for i in range(0, len(q), 10)]
            if min(least) < self.solver.barrier.safety - 1e-6:
                yield "too near an obstacle", np.array([first]), f"{min(least)} m"
