"""`Session`: robots that people, sensors and recordings move; commands in, ticks, states out.

It knows no screen and no socket. It runs wherever its ticks come from: see `cinegen.session.loop`.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.errors import CinegenError
from cinegen.mission import BasePose, MissionRecorder, Player, RecordedTask, Recording, RobotSample
from cinegen.session import commands as c
from cinegen.session.devices import Devices
from cinegen.session.driven import HAND, PIN, SENSOR, Driven, Held, Pinned
from cinegen.session.driven_obstacle import DrivenObstacle
from cinegen.session.gestures import Gestures
from cinegen.session.motion import Motors, Way
from cinegen.session.setup import Setup
from cinegen.session.state import Notice, Replayed, RobotState, State, TaskState
from cinegen.session.state import Recording as RecordingState
from cinegen.session.surroundings import driven
from cinegen.session.visit import Visit

SAMPLES = 100
"""A second, that are recorded."""

MOST_TASKS = 64
"""Nodes that may be held at once."""

_NOTICES = 8  # that are kept


class Session:
    """Robots that are driven. One thread at a time. Neither `obey` nor `tick` raises.

    Args:
        setup: what it is made of.

    Raises:
        CinegenError: a sensor, or a recording, that there can't be.
    """

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.dt = 1.0 / setup.rate
        self.robots = driven(setup)
        self._count = 0
        self.devices = Devices(setup, self.robots, self._number)
        self.time, self.paused = 0.0, False
        self._order = [name for name in setup.order() if setup.stand(name).robot is not None]
        self._hand: tuple[Driven, Held] | None = None
        self._was_pinned: Pinned | None = None  # what the hand took
        self._gestures = Gestures(self.robots, self.devices, setup.rate, self._number)
        self._notices: deque[Notice] = deque(maxlen=_NOTICES)
        self._noticed = 0
        self._answered = 0
        self._ticks = 0
        self._settings = {"gain": 100.0, "damping": 0.05}
        self._recorder: MissionRecorder | None = None
        self._recorded_in = ""
        self._recorded: list[MissionRecorder] = []  # whose files may still be written
        self._player = Player(Recording.load(setup.replay)) if setup.replay is not None else None
        if self._player is not None:
            self._player.set_speed(setup.tempo)
            if not setup.stops:
                self._player.play()
        self._obeys: dict[type[c.Command], Callable[[Any], None]] = {
            c.Take: self._take, c.Lead: self._lead, c.LetGo: self._let_go, c.Pin: self._pin, c.Release: self._release,
            c.Weigh: self._weigh, c.Holds: self._holds, c.MoveJoint: self._move_joint, c.EndJoint: self._end_joint,
            c.Home: self._home, c.Visit: self._visit, c.Undo: self._undo, c.Redo: self._redo, c.Pause: self._pause,
            c.Choose: self._choose, c.Frame: self._frame, c.View: self._view, c.Set: self._set, c.Record: self._record,
            c.Gamepad: self._gamepad, c.Play: self._replay, c.Seek: self._replay, c.Tempo: self._replay,
        }  # fmt: skip
        for name, one in self.robots.items():
            one.stand(setup.stand(name).placement)
        self._stand()
        self._set(c.Set("gain", self._settings["gain"]))
        if self._player is None:
            for switch in setup.switches:
                if switch.first is not None:
                    self.devices.choose(switch.robot, switch.node, switch.first)
        if setup.record is not None:
            self._begin_recording(setup.record)

    def close(self) -> None:
        """Ends: sensors and the recording are closed."""
        self.devices.close()
        for recorder in (*self._recorded, self._recorder):
            if recorder is not None:
                recorder.close()

    # --- in ------------------------------------------------------------------------------------------------------

    def obey(self, command: c.Command) -> None:
        """Does what a command says, as far as it can be done; else says why, as a notice."""
        self._answered += 1
        replays = isinstance(command, c.Play | c.Seek | c.Tempo)
        if (self._player is not None) != replays and not isinstance(command, c.View):
            if self._player is not None:
                self._notice("a recording is being shown: it can't be driven", warning=True)
            return
        try:
            self._obeys[type(command)](command)
        except CinegenError as error:
            self._notice(str(error), warning=True)

    def tick(self) -> None:
        """One tick of dt."""
        self._ticks += 1
        self.time += self.dt
        if self._player is not None:
            for name, q in self._player.advance(self.dt).items():
                self._show(self.robots[name], q)
        else:
            self.devices.advance(self.dt, not self.paused)
            if not self.paused:
                for one in self.robots.values():
                    self._move(one)
        if self._order:
            self._stand()
        self._gestures.tick(self._hand is not None)
        if self._recorder is not None and self._ticks % max(1, round(self.setup.rate / SAMPLES)) == 0:
            self._recorder.write(self.time, {name: _sample(one) for name, one in self.robots.items()})

    def _move(self, one: Driven) -> None:
        try:
            trouble = one.tick(self.dt)
        except CinegenError as error:  # a motion that led astray ends, and the robot stays where it is
            one.motion, trouble = None, str(error)
        if trouble:
            self._notice(trouble, warning=True)

    def _stand(self) -> None:
        """Robots on others are where those have gone."""
        for name in self._order:
            stand = self.setup.stand(name)
            if stand.robot is not None and stand.node is not None:
                self.robots[name].stand(self.robots[stand.robot].placement(stand.node) * stand.placement)

    @staticmethod
    def _show(one: Driven, q: np.ndarray) -> None:
        try:
            one.put(q)
        except CinegenError:  # a recording of what was not closed
            return

    # --- the hand ------------------------------------------------------------------------------------------------

    def _take(self, command: c.Take) -> None:
        self._let_go(c.LetGo(False))
        self._gestures.begin()
        one = self.robots[command.robot]
        one.motion = None
        self.devices.set_aside(command.robot, command.node)
        at, freedoms = pin.SE3.Identity(), (3, 3 if command.turn else 0)
        if command.point is not None:
            at = pin.SE3(np.eye(3), np.array(command.point))
        self._was_pinned = None
        for held in one.holding(PIN, command.node):  # the hand leads what is pinned, and it is pinned where it is left
            self._was_pinned = next(pinned for pinned in one.pins if pinned.node == command.node)
            one.release(held)
        held = one.take(self._number(), command.node, HAND, "hand", at, freedoms)
        self._hand = one, held

    def _lead(self, command: c.Lead) -> None:
        if self._hand is None:  # it has let go meanwhile
            return
        one, held = self._hand
        to = np.array(command.to)
        if len(to) == 7:
            one.aim(held, pin.XYZQUATToSE3(to))
        else:
            one.aim(held, pin.SE3((one.base * held.task.target).rotation, to))

    def _let_go(self, command: c.LetGo) -> None:
        if self._hand is None:
            return
        one, held = self._hand
        self._hand = None
        task = held.task
        if command.pin:
            held.who = held.label = PIN
            self.devices.give_up(one.name, task.node)
        else:
            one.release(held)
            if self._was_pinned is not None:
                was = self._was_pinned
                one.pin_again(self._number(), replace(was, target=one.placement(was.node) * was.at))
            self.devices.take_up(one.name, task.node)
        self._was_pinned = None

    # --- tasks ---------------------------------------------------------------------------------------------------

    def _pin(self, command: c.Pin) -> None:
        one = self.robots[command.robot]
        if any(one.holding(PIN, command.node)):
            return
        if sum(len(other.held) for other in self.robots.values()) >= MOST_TASKS:
            self._notice(f"{MOST_TASKS} nodes are held: release some first", warning=True)
        else:
            self._gestures.begin()
            one.take(self._number(), command.node, PIN, "pin")

    def _release(self, command: c.Release) -> None:
        for one in self.robots.values():
            for held in tuple(one.held):
                if held.number != command.task:
                    continue
                if self._hand is not None and held is self._hand[1]:
                    self._let_go(c.LetGo(False))
                elif held.who == SENSOR:
                    self.devices.choose(one.name, held.task.node, None)
                else:
                    self._gestures.begin()
                    one.release(held)

    def _weigh(self, command: c.Weigh) -> None:
        held = self._held(command.task)
        if held is not None:
            held.task.weight = command.weight

    def _holds(self, command: c.Holds) -> None:
        held = self._held(command.task)
        if held is not None:
            held.task.translation, held.task.rotation = command.translation, command.rotation

    def _held(self, number: int) -> Held | None:
        return next((held for one in self.robots.values() for held in one.held if held.number == number), None)

    # --- motors, home, there and back ----------------------------------------------------------------------------

    def _move_joint(self, command: c.MoveJoint) -> None:
        one = self.robots[command.robot]
        if not isinstance(one.motion, Motors):
            self._gestures.begin()
            self.devices.give_up_scripts(command.robot)
            one.motion = Motors(one.mechanism, one.q)
        one.motion.lead(command.joint, command.value)

    def _end_joint(self, command: c.EndJoint) -> None:
        for one in self.robots.values():
            if isinstance(one.motion, Motors):
                one.motion.end()

    def _home(self, command: c.Home) -> None:
        self._let_go(c.LetGo(False))
        self._gestures.begin()
        for name, one in self.robots.items():
            if command.robot == name or (command.robot is None and not isinstance(one, DrivenObstacle)):
                self.devices.give_up_scripts(name)
                for held in tuple(one.holding(PIN)):
                    one.release(held)
                one.motion = Way(one.mechanism, one.q, one.home, "home")

    def _visit(self, command: c.Visit) -> None:
        one = self.robots[command.robot]
        visit = Visit(one.mechanism, one.q, np.array(command.q), command.node, self.dt)
        self._let_go(c.LetGo(False))
        self._gestures.begin()
        self.devices.give_up_scripts(command.robot)
        for held in tuple(one.holding(PIN)):
            one.release(held)
        one.motion = visit

    def _undo(self, command: c.Undo) -> None:
        self._let_go(c.LetGo(False))
        self._gestures.undo()

    def _redo(self, command: c.Redo) -> None:
        self._let_go(c.LetGo(False))
        self._gestures.redo()

    # --- sensors and settings ------------------------------------------------------------------------------------

    def _choose(self, command: c.Choose) -> None:
        self.devices.choose(command.robot, command.node, command.sensor)

    def _frame(self, command: c.Frame) -> None:
        self.devices.frame = command.name

    def _view(self, command: c.View) -> None:
        x, y, z = pin.Quaternion(np.array(command.quaternion)).matrix().T
        self.devices.view = np.column_stack([x, -z, y])

    def _set(self, command: c.Set) -> None:
        if command.name in ("speed", "turning"):
            setattr(self.devices, command.name, command.value)
            return
        self._settings[command.name] = command.value
        for one in self.robots.values():
            if command.name == "gain":
                one.solver.gain = command.value
            else:
                one.solver.damping_threshold = command.value

    def _gamepad(self, command: c.Gamepad) -> None:
        self.devices.tell_gamepad(command.twist, command.buttons)

    def _pause(self, command: c.Pause) -> None:
        self.paused = command.on

    # --- recordings ----------------------------------------------------------------------------------------------

    def _record(self, command: c.Record) -> None:
        if command.on and self._recorder is None:
            self._begin_recording(time.strftime("mission-%Y%m%d-%H%M%S.jsonl"))
        elif not command.on and self._recorder is not None:
            recorder, self._recorder = self._recorder, None
            recorder.close(wait=False)
            self._recorded.append(recorder)
            self._notice(f"recorded {recorder.seconds:.1f} s in {self._recorded_in}")

    def _begin_recording(self, path: str) -> None:
        bases = {name: BasePose(stand.robot, stand.node, stand.placement) for name, stand in self.setup.stands.items()}
        self._recorder = MissionRecorder(Path(path), self.setup.robots, bases)
        self._recorded_in = path

    def _replay(self, command: c.Play | c.Seek | c.Tempo) -> None:
        if self._player is None:
            return
        if isinstance(command, c.Seek):
            self._player.seek(command.time)
        elif isinstance(command, c.Tempo):
            self._player.set_speed(command.factor)
        elif command.on:
            self._player.play()
        else:
            self._player.pause()

    # --- out -----------------------------------------------------------------------------------------------------

    def state(self) -> State:
        """How everything is."""
        recording = replay = None
        if self._recorder is not None:
            recording = RecordingState(self._recorded_in, self._recorder.seconds, self._recorder.error)
        if self._player is not None:
            replay = Replayed(
                str(self._player.recording.path),
                self._player.seconds,
                self._player.time,
                self._player.playing,
                self._player.speed,
            )
        moving = next((one.motion.name for one in self.robots.values() if one.motion is not None), None)
        return State(
            time=self.time,
            robots={name: _robot(one) for name, one in self.robots.items()},
            sensors=self.devices.states(),
            switches=dict(self.devices.chosen),
            frame=self.devices.frame,
            settings={**self._settings, "speed": self.devices.speed, "turning": self.devices.turning},
            undo=self._gestures.undo_count,
            redo=self._gestures.redo_count,
            paused=self.paused,
            moving=moving,
            recording=recording,
            replay=replay,
            notices=tuple(self._notices),
            answered=self._answered,
        )

    def _number(self) -> int:
        self._count += 1
        return self._count

    def _notice(self, words: str, warning: bool = False) -> None:
        self._noticed += 1
        self._notices.append(Notice(self._noticed, words, warning))


def _robot(one: Driven) -> RobotState:
    errors = one.step.errors if len(one.step.errors) == len(one.held) else ((0.0, 0.0),) * len(one.held)
    tasks = tuple(
        TaskState(
            held.number, task.node, held.who, held.label, held.scripted, task.offset.copy(), task.target.copy(),
            task.translation, task.rotation, task.weight, error,
        )
        for held, task, error in zip(one.held, (held.task for held in one.held), errors, strict=True)
    )  # fmt: skip
    return RobotState(one.q, one.base.copy(), tasks, one.status(), one.step.saturated, one.step.closure)


def _sample(one: Driven) -> RobotSample:
    tasks = tuple(
        RecordedTask(p.node, held.who, p.offset, one.base * p.target, p.translation, p.rotation, p.weight)
        for held, p in ((held, held.task) for held in one.held)
    )
    return RobotSample(one.q, one.status()[0], tasks)
