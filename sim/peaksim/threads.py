"""Threads for kernels that release the GIL: one pool, which works as long as any thread of the program does.

`concurrent.futures` refuses new work once the main thread has ended; these are plain threads, started when needed.
"""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import Future, wait
from queue import SimpleQueue
from threading import Lock, Thread
from typing import TypeVar

Task = TypeVar("Task")
Result = TypeVar("Result")


class _Pool:
    """Threads that wait for work; a call that nothing waits for yet is withdrawn by cancelling its future."""

    def __init__(self) -> None:
        self._calls: SimpleQueue[tuple[Future[None], Callable[[], None]]] = SimpleQueue()
        self._lock = Lock()
        self._threads = 0

    def submit(self, work: Callable[[], None], count: int) -> list[Future[None]]:
        """Return the futures of `count` calls, each for a thread of its own."""
        with self._lock:
            try:
                while self._threads < count:
                    Thread(target=self._serve, name="peaksim-kernels", daemon=True).start()
                    self._threads += 1
            except RuntimeError:  # the system gives no more threads: the caller and those that run do the work
                pass
        futures: list[Future[None]] = [Future() for _ in range(count)]
        for future in futures:
            self._calls.put((future, work))
        return futures

    def _serve(self) -> None:
        while True:
            future, work = self._calls.get()
            if future.set_running_or_notify_cancel():
                try:
                    work()
                except BaseException as error:
                    future.set_exception(error)
                else:
                    future.set_result(None)
            del future, work  # an idle thread keeps no images alive


_pool = _Pool()


def processor_count() -> int:
    """Return how many processors this process may use; where the system does not say, how many there are."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def map_in_threads(work: Callable[[Task], Result], tasks: Iterable[Task], count: int) -> list[Result]:
    """`[work(task) for task in tasks]`, shared by the caller's thread and at most `count` − 1 others.

    Raises what `work` raises, once no thread works on these tasks any more.
    """
    listed = list(tasks)
    helpers = min(count, len(listed)) - 1
    if helpers < 1:
        return [work(task) for task in listed]
    results: dict[int, Result] = {}
    waiting = iter(range(len(listed)))  # the GIL hands each index to one thread

    def take_tasks() -> None:
        for index in waiting:
            results[index] = work(listed[index])

    shared = _pool.submit(take_tasks, helpers)
    try:
        take_tasks()
    finally:
        started = [future for future in shared if not future.cancel()]
        wait(started)
    for future in started:
        future.result()
    return [results[index] for index in range(len(listed))]


def _forget_pool() -> None:
    """A forked child has none of its parent's threads."""
    global _pool
    _pool = _Pool()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_pool)
