"""The inside of a worker process: work comes in by a pipe, and what became of it goes out."""

from ctypes import c_uint64
from multiprocessing.connection import Connection

from service.workers.tasks import Setup, classify, too_much_memory, warm_up


def run(pipe: Connection, begun: c_uint64, setup: Setup) -> None:
    """Warm up, then classify what comes, until nobody is at the other end.

    Every answer is a pair: an error and None, or None and a value; the first is that of `warm_up`.
    begun: shared with the other end, how many pieces of work have arrived here.
    """
    try:
        pipe.send((None, warm_up(setup)))
    except Exception as error:
        pipe.send((error, None))
        return
    while True:
        try:
            work = pipe.recv()
        except EOFError:
            return
        except MemoryError:
            # Half of it was taken off the pipe, which is of no use any more.
            pipe.send((too_much_memory(), None))
            return
        begun.value += 1
        try:
            answer = None, classify(work)
        except Exception as error:
            answer = error, None
        pipe.send(answer)
