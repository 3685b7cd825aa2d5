"""Every hostile file ends as it must: by its own fault, soon, in little memory, opening nothing."""

import multiprocessing
import re
from collections.abc import Callable, Iterator

import pytest

from meshconv3d.model.errors import MeshError
from tests.hostile import HOSTILE
from tests.hostile.reader import serve

GUARD = 60  # seconds after which a reader hangs
# Words of libraries and of the interpreter, which say nothing to who sent the file.
LEAKED = re.compile(r"\w+Error\b|\bNone\b|numpy|dtype|expat|Python|C long|float64|Traceback")


class Reader:
    """One process for all files, begun again where one ends it."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self._process = context.Process(target=serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        assert self.connection.poll(GUARD)
        assert self.connection.recv() == len(HOSTILE)

    def read(self, title: str) -> int | Exception:
        self.connection.send(title)
        if not self.connection.poll(GUARD):
            raise TimeoutError(f"{title} hangs")
        return self.connection.recv()

    def stop(self) -> None:
        self._process.kill()
        self._process.join()


@pytest.fixture(scope="module")
def read() -> Iterator[Callable[[str], int | Exception]]:
    readers = [Reader()]

    def through(title: str) -> int | Exception:
        try:
            return readers[-1].read(title)
        except (TimeoutError, EOFError):
            readers[-1].stop()
            readers.append(Reader())
            raise

    yield through
    readers[-1].stop()


@pytest.mark.parametrize("title", HOSTILE)
def test_a_hostile_file_ends_as_it_must(read, title):
    outcome = read(title)  # across a process boundary
    if HOSTILE[title].fault is None:
        assert isinstance(outcome, int), outcome
        return
    assert isinstance(outcome, MeshError), outcome
    assert outcome.fault == HOSTILE[title].fault, outcome
    assert len(str(outcome)) < 500
    assert not LEAKED.search(str(outcome)), outcome


def test_the_catalogue_is_wide():
    assert len(HOSTILE) >= 60
    assert {file.name for file in HOSTILE.values()} >= {
        f"box.{extension}" for extension in ("obj", "off", "stl", "ply", "glb", "gltf", "3mf")
    }
