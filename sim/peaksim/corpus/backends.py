"""Where tasks run: in this process, in processes of this machine, or on the workers of a Dask scheduler.

A backend turns (work, numbers) into results as they come. The work is a function of one number that any process can
import; doing a number twice is harmless, so whatever is lost is repeated.
"""

import ctypes
import gc
import logging
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import connection, get_context, parent_process
from typing import Any, Never

from peaksim.errors import InputError, RendererError

_WINDOW = 1000  # tasks that a scheduler knows at a time

Work = Callable[[int], Any]

MOST_DEATHS = 3
"""Workers that may die over one task before the run stops."""

_PR_SET_PDEATHSIG = 1  # linux/prctl.h

_ONE_THREAD = dict.fromkeys(
    (
        "PEAKSIM_THREADS",
        "PEAKMARK_THREADS",
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "LP_NUM_THREADS",
        "OPENCV_FOR_THREADS_NUM",
    ),
    "1",
)
"""Each worker is one thread: whole frames side by side scale better than threads inside a frame."""


@dataclass(frozen=True)
class Backend:
    """Where tasks run."""

    run: Callable[[Work, Iterable[int]], Iterator[Any]]
    """Yields the results in any order."""
    is_here: bool
    """Whether the tasks run on this machine."""


def in_process() -> Backend:
    """Return the backend that runs everything in this process."""

    def run(work: Work, numbers: Iterable[int]) -> Iterator[Any]:
        return (work(number) for number in numbers)

    return Backend(run, is_here=True)


def processes(workers: int) -> Backend:
    """Return the backend of `workers` processes on this machine.

    Raises
    ------
    InputError
        If the number is not in 1…1024.
    """
    if not 1 <= workers <= 1024:
        raise InputError(f"--workers: expected 1…1024, got {workers}")

    def run(work: Work, numbers: Iterable[int]) -> Iterator[Any]:
        with _environment(_ONE_THREAD):
            yield from _Crew(work, workers).run(numbers)

    return Backend(run, is_here=True)


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


# --- processes ----------------------------------------------------------------------------------------------------


@dataclass
class _Worker:
    process: Any
    pipe: connection.Connection
    number: int


class _Crew:
    """Processes that each hold one task; one that dies is replaced and its task repeated."""

    def __init__(self, work: Work, size: int) -> None:
        self._work = work
        self._size = size
        self._context = get_context("spawn")
        self._busy: list[_Worker] = []
        self._idle: list[_Worker] = []
        self._deaths: dict[int, int] = {}

    def run(self, numbers: Iterable[int]) -> Iterator[Any]:
        """Yield results as they come; however it ends, no process is left behind."""
        waiting, lost = iter(numbers), list[int]()
        try:
            while True:
                while len(self._busy) < self._size:
                    number = lost.pop() if lost else next(waiting, None)
                    if number is None:
                        break
                    self._give(number)
                if not self._busy:
                    return
                for worker in self._finished():
                    self._busy.remove(worker)
                    yield from self._collect(worker, lost)
        finally:
            for worker in self._busy + self._idle:
                worker.process.kill()
                worker.process.join()

    def _give(self, number: int) -> None:
        worker = self._idle.pop() if self._idle else self._hire()
        worker.number = number
        self._busy.append(worker)
        with suppress(BrokenPipeError, ConnectionResetError):
            worker.pipe.send(number)  # a dead worker is noticed when its answer is awaited

    def _hire(self) -> _Worker:
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(theirs,), daemon=True)
        process.start()
        theirs.close()
        with suppress(BrokenPipeError, ConnectionResetError):
            ours.send(self._work)
        return _Worker(process, ours, -1)

    def _finished(self) -> list[_Worker]:
        """Wait until a worker has answered or died."""
        ready = connection.wait([worker.pipe for worker in self._busy])
        return [worker for worker in self._busy if worker.pipe in ready]

    def _collect(self, worker: _Worker, lost: list[int]) -> Iterator[Any]:
        try:
            failure, result = worker.pipe.recv()
        except (EOFError, OSError):
            worker.process.join()
            self._count_death(worker)
            lost.append(worker.number)
            return
        if failure is not None:
            raise failure
        self._idle.append(worker)
        yield result

    def _count_death(self, worker: _Worker) -> None:
        deaths = self._deaths[worker.number] = self._deaths.get(worker.number, 0) + 1
        if deaths >= MOST_DEATHS:
            raise RendererError(
                f"task {worker.number}: {deaths} worker processes died over it, "
                f"the last with exit code {worker.process.exitcode} (out of memory?)"
            )


def _serve(pipe: connection.Connection) -> None:
    """Answer each number with (failure, result) until the other side is gone.

    The work comes through the pipe, so that its imports begin when this process is certain to end with its
    parent. It ends without finalising the interpreter, which can wait forever for the threads of numerical and OpenGL
    libraries.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent stops its workers
    _end_with_parent()
    try:
        _answer_all(pipe)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        os._exit(0)
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(1)


def _answer_all(pipe: connection.Connection) -> Never:
    work: Work = pipe.recv()
    while True:
        pipe.send(_answer(work, pipe.recv()))


def _answer(work: Work, number: int) -> tuple[Exception | None, Any]:
    try:
        return None, work(number)
    except (InputError, RendererError) as error:
        return type(error)(str(error)), None
    except Exception:
        return RuntimeError(traceback.format_exc()), None


def _end_with_parent() -> None:
    """Have this process killed when its parent ends, however that happens.

    On Linux the kernel kills it, whatever it is doing, also when the thread that started it ends. Elsewhere a thread
    watches the parent.
    """
    parent = parent_process()
    assert parent is not None
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent.pid:  # it ended before the request
            os._exit(1)
    threading.Thread(target=_watch, args=(parent.sentinel,), daemon=True).start()


def _watch(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)


# --- Dask -----------------------------------------------------------------------------------------------------------


def on_dask(address: str) -> Backend:
    """Return the backend of a Dask scheduler such as "tcp://host:8786".

    Its run raises InputError if Dask is not installed, the scheduler does not answer within ten seconds or is lost
    midway, or a worker has more than one thread.
    """

    def run(work: Work, numbers: Iterable[int]) -> Iterator[Any]:
        with _client(address) as client:
            yield from _submit(client, work, numbers)

    return Backend(run, is_here=False)


@contextmanager
def _client(address: str) -> Iterator[Any]:
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError("--dask: needs dask: pip install 'peakmark[distributed]'") from error
    try:
        client = Client(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        # ends the client that never was now: collected while another one starts, it waits for that one's lock for ever
        traceback.clear_frames(error.__traceback__)
        gc.collect()
        raise InputError(f"--dask {address}: expected a scheduler, none answers there") from error
    with _silent("distributed"), client, _lost_in_one_line(address, client):
        for worker, state in client.scheduler_info(n_workers=-1)["workers"].items():
            if state["nthreads"] != 1:
                raise InputError(
                    f"--dask {address}: expected workers of one thread (dask worker --nthreads 1), "
                    f"{worker} has {state['nthreads']}"
                )
        yield client


@contextmanager
def _silent(library: str) -> Iterator[None]:
    """Keep a library from printing tracebacks of its own beside the one line that says what happened."""
    names = [name for name in logging.root.manager.loggerDict if name.split(".")[0] == library]
    before = {name: logging.getLogger(name).level for name in [library, *names]}
    for name in before:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)


@contextmanager
def _lost_in_one_line(address: str, client: Any) -> Iterator[None]:
    """Turn whatever a lost scheduler raises into bad input; tasks that failed by themselves stay what they are."""
    from distributed.comm import CommClosedError

    try:
        yield
    except (InputError, RendererError):
        raise
    except Exception as error:
        is_lost = isinstance(error, CancelledError | CommClosedError)  # which the client may not know yet
        if client.status == "running" and not is_lost:
            raise
        raise InputError(f"--dask {address}: the scheduler was lost; the same command resumes") from error


def _submit(client: Any, work: Work, numbers: Iterable[int]) -> Iterator[Any]:
    """Keep a window of tasks at the scheduler, so that it holds few names however many tasks there are."""
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    waiting = iter(numbers)
    futures = as_completed(loop=client.loop)

    def submit() -> None:
        number = next(waiting, None)
        if number is not None:
            futures.add(client.submit(work, number, pure=False))

    for _ in range(_WINDOW):
        submit()
    for future in futures:
        try:
            result = future.result()
        except KilledWorker as error:
            reason = " ".join(str(error).split())[:200]
            raise RendererError(f"--dask: several workers died over one task: {reason}") from error
        future.release()
        submit()
        yield result
