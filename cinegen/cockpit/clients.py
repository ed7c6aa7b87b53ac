"""Clients of a session's page: their connections, and what they have been sent."""

from __future__ import annotations

import time
from typing import Protocol

from cinegen.cockpit.messages import UserInfo

MOST = 100
"""Clients of a session."""


FRAMES = 60.0
"""States per second that clients are sent, unless one asks for more."""

FASTEST = 400
"""Messages per second that a client may send."""

BUDGET = 2000
"""Messages per second of all clients. Beyond it each gets an equal share, and those that send more must wait. Whoever
has control need not, up to the rate of one client: clients that take control in turn gain nothing."""

QUEUE = 100
"""Commands that wait for the session; while there are more, no messages are read."""


class Connection(Protocol):
    """A connection to a client. Its methods neither wait nor raise."""

    def send(self, message: str | bytes) -> None:
        """Send a message: JSON, or a state as pages get it."""

    def close(self, code: int, reason: str) -> None:
        """Close the connection."""


class TokenBucket:
    """Limits a rate.

    Args:
        burst: largest number of tokens, and the number at the start.
    """

    def __init__(self, burst: float) -> None:
        self._burst, self._tokens, self._last = burst, float(burst), time.monotonic()

    def take(self, rate: float) -> float:
        """Take a token, of which `rate` are added per second; return how many are left, negative if there was none."""
        now = time.monotonic()
        self._tokens = max(-rate, min(self._burst, self._tokens + (now - self._last) * rate) - 1.0)
        self._last = now
        return self._tokens


class Client:
    """A client: a page, or a program.

    Args:
        number: its number in the session.
        connection: connection to it.
        may_drive: whether it may send commands, and take control.
        is_page: whether it gets states as pages do, and none while nothing changes but the time.
    """

    def __init__(self, number: int, connection: Connection, may_drive: bool = True, is_page: bool = False) -> None:
        self.number, self.connection, self.may_drive, self.is_page = number, connection, may_drive, is_page
        self.unacknowledged: tuple[int, float] | None = None  # number of a state, and when it was sent
        self.sent = 0  # number of the last state
        self.met = 0  # number of the last state before it was sent other robots: until it acknowledges a later one, it
        # may name parts of those before
        self.reported = 0  # number of the last report
        self.frames = 0  # number of acknowledged states
        self.informed = 0  # number of the last list of users
        self.user: UserInfo | None = None  # once it has set a name
        self.wants_reactions = False
        self.rate = FRAMES  # states per second that it asks for
        self._rate = TokenBucket(FASTEST)
        self.share = TokenBucket(BUDGET / MOST)  # used while all together send too much

    def __repr__(self) -> str:
        return f"<Client {self.number}: {self.frames} states>"

    def exceeds_rate(self) -> bool:
        """Return whether it sends too many messages; called for each of them."""
        return self._rate.take(FASTEST) < 0.0
