"""What a session tells, as values that go to another process: where everything is, who holds what."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.devices import SensorStatus
from cinegen.sensor import Twist

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TaskState:
    """A task.

    Attributes:
        number: its own in the session.
        node: that is held.
        who: holds it: "hand", "pin" or "sensor".
        label: what people call it.
        scripted: whether a script leads it, which goes nowhere else.
        offset: frame fixed on the node that is constrained, in the node's frame (m).
        target: where that should be, as seen from where the robot stands.
        translation: how many translations it holds.
        rotation: how many rotations.
        weight: of it.
        error: what is left of the way, m and rad.
    """

    number: int
    node: str
    who: str
    label: str
    scripted: bool
    offset: pin.SE3
    target: pin.SE3
    translation: int
    rotation: int
    weight: float
    error: tuple[float, float]


@dataclass(frozen=True, slots=True)
class RobotState:
    """A robot.

    Attributes:
        q: (nq,) where it is, loops closed.
        base: where it stands, in the session's world.
        tasks: what holds it.
        status: of the last tick, and words for people.
        saturated: joints whose limit holds the motion back.
        closure: the largest gap of its loops, rad or characteristic lengths.
    """

    q: Array
    base: pin.SE3
    tasks: tuple[TaskState, ...]
    status: tuple[str, str]
    saturated: tuple[str, ...]
    closure: float


@dataclass(frozen=True, slots=True)
class SensorState:
    """A sensor.

    Attributes:
        name: in the session.
        status: what it is doing.
        twist: how far it is deflected; None if it says nothing of that.
    """

    name: str
    status: SensorStatus
    twist: Twist | None


@dataclass(frozen=True, slots=True)
class Notice:
    """Something that people should be told once.

    Attributes:
        number: counted from 1.
        words: a sentence.
        warning: whether something is wrong.
    """

    number: int
    words: str
    warning: bool


@dataclass(frozen=True, slots=True)
class Recording:
    """A recording that is being made.

    Attributes:
        file: its path.
        seconds: how long it is.
        error: why it can't be written any more; None while it can.
    """

    file: str
    seconds: float
    error: str | None


@dataclass(frozen=True, slots=True)
class Replayed:
    """A recording that is being shown.

    Attributes:
        file: its path.
        seconds: how long it is.
        time: s from its beginning.
        playing: whether it goes on.
        tempo: how fast; 1 is as it was.
    """

    file: str
    seconds: float
    time: float
    playing: bool
    tempo: float


@dataclass(frozen=True, slots=True)
class State:
    """A session at a moment.

    Attributes:
        time: s since it began.
        robots: by name.
        sensors: all of them.
        switches: which sensor holds each node that one may hold; None: none.
        frame: of command.
        settings: gain (1/s), damping, speed (m/s), turning (rad/s).
        undo: how many gestures can be undone.
        redo: how many can be done again.
        paused: whether everything stands still.
        moving: what goes on by itself: "home", "visit", "undo", "redo", "motors"; None: nothing.
        recording: that is being made.
        replay: that is being shown.
        notices: the last few.
        answered: how many commands were obeyed.
    """

    time: float
    robots: dict[str, RobotState]
    sensors: tuple[SensorState, ...]
    switches: dict[tuple[str, str], str | None]
    frame: str
    settings: dict[str, float]
    undo: int
    redo: int
    paused: bool
    moving: str | None
    recording: Recording | None
    replay: Replayed | None
    notices: tuple[Notice, ...]
    answered: int
