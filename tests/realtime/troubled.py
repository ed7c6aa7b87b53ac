"""What goes wrong in a clock's process: a module of its own, so that such a process imports little."""

import os
import time


def trip(tick):
    if tick.number >= 3:
        raise RuntimeError("tripped")


class UnsendableError(Exception):
    def __init__(self, first, second):
        super().__init__(first)


def troubled(kind, fifo=None):
    """Made in the clock's process; one that hangs opens a FIFO first."""

    def step(tick):
        if kind == "stop":
            if tick.number >= 10:
                tick.clock.stop()
        elif kind == "raise":
            trip(tick)
        elif kind == "unsendable":
            raise UnsendableError("one", "two")
        elif kind == "exit":
            os._exit(3)
        elif kind == "hang":
            open(fifo, "w").close()
            time.sleep(60.0)
        return tick.number

    if kind == "factory":
        raise RuntimeError("not made")
    return step
