"""Period, gain and damping of a solver."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.ik._kernels.memory import SolverMemory
from cinegen.ik.control.joints import JointControl
from cinegen.ik.step import Layout

LONGEST = 10.0
"""Longest period of a tick, s: more was meant as a rate."""


class RateControl(JointControl):
    """Control of a solver's period, gain and damping at run time."""

    __slots__ = ("_dt", "_earlier", "_gain", "_latest", "_layout", "_lifted", "_memory")

    _dt: float
    _gain: float
    _memory: SolverMemory
    _layout: Layout
    _lifted: tuple[bool, bool]  # limits of velocity, and of position, are ignored
    _earlier: Array | None  # records of the last two ticks: they tell how fast targets move
    _latest: Array | None

    @property
    def dt(self) -> float:
        """Period of a tick, s; may be set at any time. Velocities continue: the step of the last tick, and what limits
        the next one, are scaled.

        Raises:
            CinegenError: set to a time that is not positive, or longer than 10 s.
        """
        return self._dt

    @dt.setter
    def dt(self, dt: float) -> None:
        if dt == self._dt:
            return
        with self._used():
            self._scale_to(dt)

    def _scale_to(self, dt: float) -> None:
        memory, ratio = self._memory, checked_period(dt) / self._dt
        self._dt = memory.dt = dt
        self.gain = self._gain
        for steps in (memory.last, memory.drift, memory.secondary):
            steps *= ratio
        self._joints.write(memory, self._lifted)
        self._layout = replace(self._layout, dt=dt)
        self._earlier = None

    @property
    def gain(self) -> float:
        """Rate at which pose errors decay, 1/s; may be set at any time.

        A tick corrects the fraction 1 - exp(-gain dt) of each error, so the decay does not depend on dt. With an
        infinite gain, the default, a tick corrects all of it, as far as limits allow.

        Raises:
            CinegenError: set to a value that is not above 0, or another thread uses the solver.
        """
        return self._gain

    @gain.setter
    def gain(self, gain: float) -> None:
        if not gain > 0.0:
            raise CinegenError(f"gain must be above 0 (1/s), not {gain}")
        self._check_thread()
        self._gain = float(gain)
        self._memory.gain = -math.expm1(-self._gain * self.dt)

    @property
    def tick_gain(self) -> float:
        """Fraction of an error that one tick corrects: 1 - exp(-gain dt)."""
        return float(self._memory.gain)

    @property
    def damping_threshold(self) -> float:
        """Dimensionless singular value, without the weights of tasks, below which motion is damped; 0.05 by default.

        A larger value makes motion near singularities slower and smoother. It may be set at any time.

        Raises:
            CinegenError: set to a value outside (0, 1], or another thread uses the solver.
        """
        return float(self._memory.damping_threshold)

    @damping_threshold.setter
    def damping_threshold(self, near: float) -> None:
        if not 0.0 < near <= 1.0:
            raise CinegenError(f"damping_threshold must be in (0, 1], not {near}")
        self._check_thread()
        self._memory.damping_threshold = near


def checked_period(dt: float) -> float:
    """Return a valid period, s.

    Raises:
        CinegenError: it is not positive, or longer than 10 s.
    """
    if not (np.isfinite(dt) and dt > 0.0):
        raise CinegenError(f"dt must be a positive time in seconds, not {dt}")
    if dt > LONGEST:
        message = f"dt is the period of a tick in seconds, at most {LONGEST:g}, not {dt:g}: did you mean 1/{dt:g}?"
        raise CinegenError(message)
    return dt
