"""The inside of a worker process: work comes in by a socket, and what became of it goes out."""

import socket
from contextlib import suppress
from ctypes import c_uint64

from meshconv3d.service.workers.frames import framed, read_frame
from meshconv3d.service.workers.tasks import Setup, classify, too_much_memory, warm_up

# Under which number the first answer goes out; work is numbered from 1, as it comes.
WARM_UP = 0


def run(pipe: socket.socket, begun: c_uint64, taken_back: c_uint64, setup: Setup) -> None:
    """Warm up, then classify what comes, until nobody is at the other end.

    Every answer is a number, and an error and None, or None and a value; the first is that of
    `warm_up`, and that to work that was taken back has neither. begun and taken_back are shared
    with the other end: the number of the latest work that has arrived here, and of the one that is
    to be done elsewhere. Each is written before the other is read, here as there: it may be left
    undone on both ends, which this one tells. It is done on both only where a later one is taken
    back before this end has come to it, and then nobody asks for the answer.
    """
    with suppress(EOFError, OSError):
        _work(pipe, begun, taken_back, setup)


def _work(pipe: socket.socket, begun: c_uint64, taken_back: c_uint64, setup: Setup) -> None:
    """See `run`. Raises EOFError or OSError once nobody sends, or reads."""

    def answer(number: int, error: Exception | None, value: object) -> None:
        pipe.sendall(b"".join(framed((number, error, value))))

    try:
        answer(WARM_UP, None, warm_up(setup))
    except Exception as error:
        answer(WARM_UP, error, None)
        return
    stream = pipe.makefile("rb")
    while True:
        try:
            work = read_frame(stream)
        except MemoryError:
            # Half of it was taken off the stream, which is of no use any more.
            answer(begun.value + 1, too_much_memory(), None)
            return
        begun.value += 1
        number = begun.value
        error, value = None, None
        if taken_back.value != number:
            try:
                value = classify(work)
            except Exception as raised:
                error = raised
        answer(number, error, value)
