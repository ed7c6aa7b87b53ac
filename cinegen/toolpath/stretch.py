"""From rest to rest: how far one is along a stretch after a time."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Stretch:
    """Begins and ends at rest, and has constant speed in between. Neither speed nor acceleration jumps.

    The speed grows as 3 x^2 - 2 x^3 of the ramp's part x. A stretch that is too short for its speed has less.

    Args:
        length: m, or rad, more than 0.
        speed: m/s or rad/s, more than 0.
        ramp: s from rest to full speed.
    """

    length: float
    speed: float
    ramp: float

    @property
    def top(self) -> float:
        """The speed that it comes to, m/s or rad/s."""
        return min(self.speed, self.length / self.ramp) if self.ramp > 0.0 else self.speed

    @property
    def duration(self) -> float:
        """s."""
        return self.ramp + self.length / self.top

    def at(self, time: float) -> float:
        """How far (m or rad) after a time (s) since its beginning."""
        duration = self.duration
        if time > 0.5 * duration:
            return self.length - self._since(max(0.0, duration - time))
        return self._since(max(0.0, time))

    def _since(self, time: float) -> float:
        """In its first half."""
        if time >= self.ramp:
            return self.top * (time - 0.5 * self.ramp)
        x = time / self.ramp
        return self.top * self.ramp * x * x * x * (1.0 - 0.5 * x)
