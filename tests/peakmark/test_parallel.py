"""The thread pool: order, count and forks."""

import itertools
import os
import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from peakmark import parallel
from peakmark.errors import InputError
from tests.peaksim.corpus.helpers import child_environment


@given(st.integers(0, 1000), st.integers(1, 50))
def test_bands_cover_the_range_once_and_evenly(length: int, count: int) -> None:
    cut = parallel.bands(length, count)
    assert [i for first, last in cut for i in range(first, last)] == list(range(length))
    lengths = [last - first for first, last in cut]
    assert len(cut) <= count
    assert not lengths or max(lengths) - min(lengths) <= 1


@pytest.mark.parametrize("count", [1, 2, 5])
def test_results_come_in_the_order_of_the_tasks(count: int) -> None:
    with parallel.threads(count):
        assert parallel.map_parallel(lambda x: x * x, range(50)) == [x * x for x in range(50)]


@pytest.mark.parametrize("count", [1, 2, 5])
def test_tasks_are_drawn_little_ahead_and_come_in_their_order(count: int) -> None:
    drawn: list[int] = []

    def endless() -> Iterator[int]:
        for number in itertools.count():
            drawn.append(number)
            yield number

    for number, (task, result) in enumerate(parallel.map_ahead(lambda x: x * x, endless(), count)):
        assert (task, result) == (number, number * number)
        assert len(drawn) <= number + 1 + count
        if number == 20:
            break


@pytest.mark.parametrize("count", [1, 3])
def test_what_ends_the_tasks_comes_after_their_results(count: int) -> None:
    def broken() -> Iterator[int]:
        yield from (1, 2)
        raise ValueError("cut")

    got: list[int] = []
    with pytest.raises(ValueError, match="cut"):
        got.extend(result for _, result in parallel.map_ahead(lambda x: 10 * x, broken(), count))
    assert got == [10, 20]


def test_work_ahead_is_done_on_one_thread_each() -> None:
    with parallel.threads(4):
        counts = [result for _, result in parallel.map_ahead(lambda _: parallel.thread_count(), range(5), 3)]
        assert counts == [1] * 5
        assert parallel.thread_count() == 4


def test_several_threads_work() -> None:
    barrier = threading.Barrier(2)
    with parallel.threads(2):
        assert parallel.map_parallel(lambda _: barrier.wait(timeout=20), range(2)).count(0) == 1


def test_tasks_may_have_tasks() -> None:
    with parallel.threads(2):
        squares = parallel.map_parallel(lambda n: sum(parallel.map_parallel(lambda x: x * x, range(n))), range(40))
    assert squares == [sum(x * x for x in range(n)) for n in range(40)]


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("bad", [0, 7, 19])
def test_what_a_task_raises_is_raised(count: int, bad: int) -> None:
    def work(task: int) -> int:
        if task == bad:
            raise IndexError(f"task {task}")
        return task

    with parallel.threads(count):
        with pytest.raises(IndexError, match=f"task {bad}"):
            parallel.map_parallel(work, range(20))
        assert parallel.map_parallel(abs, range(3)) == [0, 1, 2]


def test_the_count_is_the_callers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PEAKMARK_THREADS", "3")
    assert parallel.thread_count() == 3
    with parallel.threads(7):
        assert parallel.thread_count() == 7
    assert parallel.thread_count() == 3
    monkeypatch.delenv("PEAKMARK_THREADS")
    assert parallel.thread_count() == len(os.sched_getaffinity(0))
    with pytest.raises(InputError, match="at least 1, got 0"):
        parallel.set_thread_count(0)


FORK = """
import os
from peakmark import parallel
with parallel.threads(2):
    parallel.map_parallel(abs, range(4))
    child = os.fork()
    if child == 0:
        os._exit(0 if parallel.map_parallel(abs, range(-4, 0)) == [4, 3, 2, 1] else 1)
    raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


def test_a_forked_child_gets_its_own_pool() -> None:
    """In a process of its own: the threads of other tests do not survive a fork either."""
    done = subprocess.run([sys.executable, "-c", FORK], env=child_environment(), timeout=60, check=False)
    assert done.returncode == 0


OUTLIVES = """
import os, threading
os.environ["PEAKSIM_THREADS"] = "2"
import numpy as np
import peaksim
from peakmark import identify, marker, parallel, surf

def work():
    threading.main_thread().join()
    barrier = threading.Barrier(2)  # more than one thread still works
    with parallel.threads(2):
        parallel.map_parallel(lambda _: barrier.wait(timeout=20), range(2))
        image = np.pad(marker.surf_marker(side_px=45), 40, constant_values=255)
        found = len(surf.detect_and_describe(image).xy), len(identify(image, stretch=1.0))
    frame = peaksim.render(peaksim.Scene(), peaksim.Camera(), np.eye(4), renderer="exact")
    os.write(1, repr((found[0] > 0, found[1], int(frame.image[0, 0]))).encode())

threading.Thread(target=work).start()
"""


def test_a_thread_that_outlives_the_main_thread_detects_identifies_and_renders() -> None:
    done = subprocess.run(
        [sys.executable, "-c", OUTLIVES], env=child_environment(), timeout=600, capture_output=True, check=False
    )
    assert (done.stdout, done.stderr, done.returncode) == (b"(True, 1, 128)", b"", 0)
