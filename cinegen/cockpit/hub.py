"""`Hub`: the clients of a session. Each gets the newest state as fast as it accepts it; one at a time has control."""

from __future__ import annotations

import time
from collections.abc import Callable

from msgspec import UNSET
from msgspec.structs import asdict, replace

from cinegen.arrays import Integers
from cinegen.cockpit.clients import BUDGET, FASTEST, FRAMES, MOST, QUEUE, Client, Connection, TokenBucket
from cinegen.cockpit.messages import (
    CLIENT_MESSAGES,
    Ack,
    HelloMessage,
    NoticeMessage,
    ProblemMessage,
    ReportMessage,
    RequestControl,
    RequestRate,
    RequestReactions,
    SetCursor,
    SetUser,
    StateMessage,
    UserInfo,
)
from cinegen.cockpit.page_state import moving_rows, page_state, shown_of
from cinegen.session import Command, CommandError, Setup
from cinegen.session.commands import ControlPlayback, EndDrag, EndJointMotion, SetView
from cinegen.session.decoding import check_names, decode
from cinegen.typed_json import encode

USERS = 0.1
"""Time between two messages about users, s, at least."""

PATIENCE = 30.0
"""Time that a client has to acknowledge a state, s."""

VIEW_ONLY = "this address only shows the robots: ask for the one with which to drive them"
"""Notice to a client that only views, and sends a command."""

_POLICY_VIOLATION = 1008  # close codes of websockets
_TRY_AGAIN_LATER = 1013


class Hub:
    """The clients of a session, and which one has control. For one thread at a time; nothing here waits or raises.

    Args:
        setup: setup of the session.
        send: takes commands.
        hello: returns the first message to a client, by its number.
        wake: called when the first client has come, or the last one gone.
        waiting: returns the number of commands that were sent and not begun yet.

    Attributes:
        clients: clients by number.
        controller: number of the client that has control; None: none has.
        changed: number of the last state that differs from the one before in more than its time: pages get no others.
    """

    def __init__(
        self,
        setup: Setup,
        send: Callable[[Command], None],
        hello: Callable[[int], HelloMessage],
        wake: Callable[[], None] = lambda: None,
        waiting: Callable[[], int] = lambda: 0,
    ) -> None:
        self.clients: dict[int, Client] = {}
        self.controller: int | None = None
        self._setup, self._send, self._hello, self._wake = setup, send, hello, wake
        self._waiting = waiting
        self._count = 0
        self._budget = TokenBucket(BUDGET)
        self._control = TokenBucket(FASTEST)
        self._state: tuple[int, StateMessage | None] = (0, None)
        self._report: tuple[int, ReportMessage | None] = (0, None)
        self._users: tuple[int, tuple[UserInfo, ...]] = (0, ())
        self._listed = 0.0  # when users were listed
        self._problem = ""
        self.changed = 0
        self._content: tuple[object, ...] | None = None  # of that: what must change for the next
        self._shown: tuple[bytes, bytes] | None = None  # of the newest state, as pages get it, once one does
        self._rows: dict[str, Integers] = {}  # poses that pages get
        self._encoded: dict[tuple[bool, bool, bool], str | bytes] = {}  # of the newest state: with the report, with the
        # users, for pages

    # --- connections ---------------------------------------------------------------------------------------------

    def join(self, connection: Connection, may_drive: bool = True, is_page: bool = False) -> Client | None:
        """Add a client, which may send commands or only views; None if there is no room."""
        if len(self.clients) >= MOST:
            connection.close(_TRY_AGAIN_LATER, f"this session has {MOST} clients already")
            return None
        self._count += 1
        client = Client(self._count, connection, may_drive, is_page)
        self.clients[client.number] = client
        if len(self.clients) == 1:
            self._wake()
        self._greet(client)
        if self._problem:
            connection.send(encode(ProblemMessage(self._problem)).decode())
        self._feed(client)
        return client

    def exchange(self, setup: Setup) -> None:
        """Let all clients meet the robots of another setup, which the next states are of."""
        self._setup = setup
        self._state, self._report, self._encoded = (self._state[0], None), (self._report[0], None), {}
        self._content = None
        for client in tuple(self.clients.values()):
            client.met = self._state[0] + 1
            if client.user is not None:
                client.user = replace(client.user, robot=None, node=None)
            self._greet(client)

    def _greet(self, client: Client) -> None:
        hello = self._hello(client.number)
        if not client.may_drive:
            hello = replace(hello, view_only=True, view_token=None)
        self._rows = moving_rows(hello)
        client.connection.send(encode(hello).decode())

    def state_problem(self, text: str) -> None:
        """State to all clients, also to those that come later, what is wrong with the robots' files; empty: nothing."""
        if text == self._problem:
            return
        self._problem = text
        for client in tuple(self.clients.values()):
            client.connection.send(encode(ProblemMessage(text)).decode())

    @property
    def wants_reactions(self) -> bool:
        """True if a client has asked for reactions."""
        return any(client.wants_reactions for client in tuple(self.clients.values()))

    @property
    def rate(self) -> float:
        """Highest rate of states (Hz) that a client has asked for."""
        return max((client.rate for client in tuple(self.clients.values())), default=FRAMES)

    def leave(self, client: Client) -> None:
        """Remove a client that has gone; its control ends."""
        if self.clients.pop(client.number, None) is None:
            return
        if self.controller == client.number:
            self._end_control()
        if not self.clients:
            self._state, self._report = (self._state[0], None), (self._report[0], None)  # they grow old
            self._content = None
            self._wake()

    def drop(self, client: Client, reason: str) -> None:
        """Disconnect a client, with a reason."""
        self.leave(client)
        client.connection.close(_POLICY_VIOLATION, reason)

    # --- messages from clients -----------------------------------------------------------------------------------

    def receive(self, client: Client, text: str | bytes) -> None:
        """Handle a message of a client; one that is not valid disconnects it."""
        if client.number not in self.clients:  # it was disconnected
            return
        if client.exceeds_rate():
            self.drop(client, f"more than {FASTEST} messages per second")
            return
        try:
            message = decode(text, CLIENT_MESSAGES)
            if isinstance(message, Ack):
                self._acknowledged(client, message.frame)
            elif not client.may_drive and isinstance(message, RequestControl | Command):
                self._refuse(client, message)
            elif isinstance(message, RequestControl):
                self._request_control(client, message.on)
            elif isinstance(message, RequestReactions | RequestRate | SetUser):
                self._configure(client, message)
            elif not self._names_parts(client, message):
                return
            elif isinstance(message, SetCursor):
                if client.user is not None:
                    client.user = replace(client.user, **asdict(message))
                    self._show_again()
            else:
                self._command(client, message)
        except CommandError as error:
            self.drop(client, str(error))

    def _configure(self, client: Client, message: RequestReactions | RequestRate | SetUser) -> None:
        """Set what a client receives, or how its user is shown."""
        if isinstance(message, RequestReactions):
            client.wants_reactions = message.on
        elif isinstance(message, RequestRate):
            client.rate = message.rate or FRAMES
        else:
            user = client.user or UserInfo(client.number, "", 0)
            client.user = replace(user, name=message.name, colour=message.colour)
            self._show_again()

    def _names_parts(self, client: Client, message: SetCursor | Command) -> bool:
        """Return whether the parts exist that a message names. If not, it is late: it was sent before its client knew
        of the present robots.

        Raises:
            CommandError: they don't exist, and the client knows that.
        """
        try:
            check_names(message, self._setup)
        except CommandError:
            if client.met == 0:
                raise
            return False
        return True

    def pause(self, client: Client) -> float:
        """Return the time until the next message of a client is read, s; called after each of them."""
        if self._budget.take(BUDGET) >= 0.0 or (
            client.number == self.controller and self._control.take(FASTEST) >= 0.0
        ):
            return 0.0
        share = BUDGET / max(1, len(self.clients))
        return max(0.0, -client.share.take(share)) / share

    def queue_is_full(self) -> bool:
        """Return whether the next message must wait for commands that are carried out slowly."""
        return self._waiting() > QUEUE

    def _acknowledged(self, client: Client, frame: int) -> None:
        if client.unacknowledged is not None and client.unacknowledged[0] == frame:
            client.unacknowledged = None
            client.frames += 1
            if frame >= client.met:
                client.met = 0
            self._feed(client)

    def _request_control(self, client: Client, on: bool) -> None:
        if on and self.controller != client.number:
            before = self.clients.get(self.controller or 0)
            self._end_control()
            self.controller = client.number
            if before is not None:
                self.notify(before, "another browser has taken control")
            self._show_again()
        elif not on and self.controller == client.number:
            self._end_control()

    def _refuse(self, client: Client, message: RequestControl | Command) -> None:
        """Refuse what a client that only views may not do."""
        if not isinstance(message, SetView | EndDrag | EndJointMotion | ControlPlayback):  # which pages send unasked
            self.notify(client, VIEW_ONLY, warning=True)

    def _command(self, client: Client, command: Command) -> None:
        if isinstance(command, SetView):
            if self.controller in (None, client.number):
                self._send(command)
            return
        if self.controller is None and not isinstance(command, EndDrag | EndJointMotion):
            self.controller = client.number
            self._show_again()
        if self.controller == client.number:
            self._send(command)
        elif not isinstance(command, EndDrag | EndJointMotion | ControlPlayback):
            self.notify(client, "another browser has control: take it first", warning=True)

    def _end_control(self) -> None:
        if self.controller is not None:
            self.controller = None
            self._send(EndDrag())
            self._send(EndJointMotion())
            self._show_again()

    # --- messages to clients -------------------------------------------------------------------------------------

    def show(self, state: StateMessage, report: ReportMessage | None = None) -> None:
        """Send a new state, and maybe a new report, to all clients that wait for one; to pages if it is news."""
        number = self._state[0] + 1
        self._state, self._encoded = (number, state), {}
        if report is not None and not _is_known(report, self._report[1]):
            self._report = self._report[0] + 1, report
        now = time.monotonic()
        self._list_users(now)
        is_seen = any(client.is_page for client in tuple(self.clients.values()))
        self._shown = shown_of(state, self._rows) if is_seen else None
        content = self._shown, self.controller, self._report[0], self._users[0]
        if not is_seen or content != self._content:
            self.changed, self._content = number, content
        for client in tuple(self.clients.values()):
            if client.unacknowledged is None:
                self._feed(client)
            elif now - client.unacknowledged[1] > PATIENCE:
                self.leave(client)
                client.connection.close(1001, f"no state was acknowledged for {PATIENCE:g} s")

    def _show_again(self) -> None:
        """Show who has control, and the users: a session at rest has a new state in a quarter of a second only."""
        if self._state[1] is not None:
            self.show(self._state[1])

    def _list_users(self, now: float) -> None:
        """List the users anew if they have changed, and were not listed recently."""
        users = tuple(client.user for client in tuple(self.clients.values()) if client.user is not None)
        if now - self._listed >= USERS and users != self._users[1]:
            self._users, self._listed = (self._users[0] + 1, users), now

    def notify(self, client: Client, text: str, warning: bool = False) -> None:
        """Send a notice to a client."""
        client.connection.send(encode(NoticeMessage(text, "warning" if warning else "info")).decode())

    def notify_all(self, text: str, warning: bool = False) -> None:
        """Send a notice to all clients."""
        for client in tuple(self.clients.values()):
            self.notify(client, text, warning)

    def _feed(self, client: Client) -> None:
        """Send the newest state, unless the client has it."""
        number, state = self._state
        newest = self.changed if client.is_page else number
        if state is None or newest <= client.sent or client.unacknowledged is not None:
            return
        new = self._report[0] > client.reported, self._users[0] > client.informed, client.is_page
        if new not in self._encoded:
            report = self._report[1] if new[0] and self._report[1] is not None else UNSET
            users = self._users[1] if new[1] else UNSET
            numbered = replace(state, frame=number, controller=self.controller, report=report, users=users)
            if client.is_page:
                self._shown = self._shown or shown_of(state, self._rows)
                self._encoded[new] = page_state(numbered, self._shown)
            else:
                self._encoded[new] = encode(numbered).decode()
        client.sent, client.reported, client.informed = number, self._report[0], self._users[0]
        client.unacknowledged = number, time.monotonic()
        client.connection.send(self._encoded[new])


def _is_known(report: ReportMessage, before: ReportMessage | None) -> bool:
    """Return whether a report of a session that stays at rest repeats the one before, but for the rate of its ticks."""
    if before is None or not (report.rate.at_rest and before.rate.at_rest):
        return False
    return encode(replace(report, rate=before.rate)) == encode(before)
