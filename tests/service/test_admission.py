"""How much work is taken on, by a clock of the test's own."""

import pytest

from meshconv3d.service.http.admission import Admission, Admitted
from meshconv3d.service.http.problems import Full


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def admission(clock: Clock) -> Admission:
    return Admission(max_meshes=100, max_bytes=1000, patience=10.0, workers=2, clock=clock)


def busy(admission: Admission, clock: Clock, seconds: float) -> None:
    """Fifty requests, of which ten are answered, one in so many seconds."""
    for _ in range(50):
        admission.enter()
    for _ in range(10):
        clock.now += seconds
        admission.answer()


def test_places_are_counted(admission: Admission) -> None:
    for _ in range(100):
        admission.arrive()
        admission.enter()
    with pytest.raises(Full, match="100 requests"):
        admission.arrive()
    with pytest.raises(Full):
        admission.enter()
    admission.answer()
    admission.arrive()


def test_uploads_take_bytes_but_no_place(admission: Admission) -> None:
    for _ in range(200):
        admission.arrive()
        admission.reserve(5)
    with pytest.raises(Full, match="1000 bytes"):
        admission.reserve(1)


def test_a_request_that_finds_no_room_gives_back_what_it_had(admission: Admission) -> None:
    shares = [Admitted(admission, expires=9.0) for _ in range(3)]
    for share in shares[:2]:
        share.reserve(400)
        share.hold(300)
        share.enter(1)
    with pytest.raises(Full, match="800 bytes"):
        shares[2].reserve(400)
    with pytest.raises(Full):
        shares[1].hold(500)
    assert (admission.reserved_bytes, admission.bytes, admission.meshes) == (400, 300, 1)
    shares[2].reserve(600)
    shares[0].release()
    assert (admission.reserved_bytes, admission.bytes, admission.meshes) == (600, 0, 0)


def test_the_wait_follows_from_the_rate(admission: Admission, clock: Clock) -> None:
    assert admission.wait() == 0
    busy(admission, clock, 0.1)
    assert admission.wait() == pytest.approx(40 * 0.1, rel=0.15)


def test_who_would_wait_too_long_is_refused_at_once(admission: Admission, clock: Clock) -> None:
    busy(admission, clock, 0.5)  # the forty that are left take 20 s
    with pytest.raises(Full) as refused:
        admission.arrive()
    assert 7 <= refused.value.retry_after <= 10


def test_a_service_that_hangs_is_seen_to_slow_down(admission: Admission, clock: Clock) -> None:
    busy(admission, clock, 0.1)
    admission.arrive()
    clock.now += 10
    with pytest.raises(Full):
        admission.arrive()


@pytest.mark.parametrize("running", [0, 1])
def test_idle_time_is_no_measure_of_the_rate(
    admission: Admission, clock: Clock, running: int
) -> None:
    """Of one worker, either: the other may have taken long over one mesh."""
    busy(admission, clock, 0.1)
    for _ in range(40 - running):
        admission.answer()
    clock.now += 1000
    admission.arrive()
    admission.enter()
    assert admission.wait() == 0


def test_what_leaves_without_an_answer_says_nothing_of_the_rate(
    admission: Admission, clock: Clock
) -> None:
    busy(admission, clock, 0.1)
    before = admission.wait()
    admission.enter(20)
    admission.leave(20)
    assert admission.wait() == before


def test_once_closed_it_ends_with_the_last_visitor(admission: Admission) -> None:
    admission.arrive()
    admission.close()
    with pytest.raises(Full, match="stopping"):
        admission.arrive()
    assert not admission.idle
    admission.depart()
    assert admission.idle
