"""Leading a session by commands, as people at its page do."""

from cinegen.session import Session
from cinegen.session.commands import Command
from cinegen.session.state import SessionState


def run(session: Session, seconds: float, *commands: Command) -> SessionState:
    """Obey commands, tick for some seconds, and return the state then."""
    for command in commands:
        session.obey(command)
    for _ in range(round(seconds / session.dt)):
        session.tick()
    return session.state()
