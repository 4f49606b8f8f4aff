"""Threads for kernels that release the GIL: a count the caller controls, on the pool of `peaksim.threads`.

Work is cut into bands whose results do not depend on the cut, and joined in band order, so the bytes are the same
for any number of threads.
"""

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from itertools import pairwise
from typing import TypeVar

from peaksim.threads import map_in_threads, processor_count

from peakmark.errors import InputError

Task = TypeVar("Task")
Result = TypeVar("Result")

_threads: int | None = None


def thread_count() -> int:
    """Number of threads in use: the last `set_thread_count`, else PEAKMARK_THREADS, else the CPUs allowed to us."""
    if _threads is not None:
        return _threads
    asked = os.environ.get("PEAKMARK_THREADS", "")
    return int(asked) if asked.isdigit() and int(asked) > 0 else processor_count()


def set_thread_count(count: int | None) -> None:
    """Use `count` threads from now on; None returns to the default.

    Raises
    ------
    InputError
        If the count is below 1.
    """
    global _threads
    if count is not None and count < 1:
        raise InputError(f"threads: expected a count of at least 1, got {count}")
    _threads = count


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Use `count` threads inside a `with` block."""
    before = _threads
    set_thread_count(count)
    try:
        yield
    finally:
        set_thread_count(before)


def map_parallel(work: Callable[[Task], Result], tasks: Iterable[Task]) -> list[Result]:
    """`[work(task) for task in tasks]`, shared between the caller's thread and the pool; results in task order.

    Raises what `work` raises, once no thread works on these tasks any more.
    """
    return map_in_threads(work, tasks, thread_count())


def map_ahead(work: Callable[[Task], Result], tasks: Iterable[Task], count: int) -> Iterator[tuple[Task, Result]]:
    """Yield each task with `work(task)` in the order of the tasks, which may be endless.

    `count` threads work side by side, and each on one thread; the caller's thread draws the tasks, at most `count` more
    than it has yielded, so that a film is decoded while its frames are worked on. With 1 all is done in the caller's
    thread, and each task is yielded before the next is drawn. What `work` or `tasks` raise comes in its turn.
    """
    if count == 1:
        yield from ((task, work(task)) for task in tasks)
        return
    drawn = iter(tasks)
    waiting: deque[tuple[Task, Future[Result]]] = deque()
    ended: Exception | None = None

    def draw_one() -> None:
        nonlocal ended
        if ended is None:
            try:
                task = next(drawn)
            except Exception as error:  # the end, or what the tasks raise: after all that came before it
                ended = error
            else:
                waiting.append((task, pool.submit(work, task)))

    with threads(1), ThreadPoolExecutor(count, "peakmark-ahead") as pool:
        try:
            for _ in range(count):
                draw_one()
            while waiting:
                draw_one()
                task, future = waiting.popleft()
                yield task, future.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
    if ended is not None and not isinstance(ended, StopIteration):
        raise ended


def bands(length: int, count: int) -> list[tuple[int, int]]:
    """Cut range(length) into at most `count` half-open bands of nearly equal length, none empty.

    >>> bands(10, 3)
    [(0, 3), (3, 6), (6, 10)]
    """
    count = max(1, min(count, length))
    edges = [length * index // count for index in range(count + 1)]
    return [(first, last) for first, last in pairwise(edges) if last > first]
