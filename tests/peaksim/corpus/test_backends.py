"""Backends: every number is done, whatever dies; errors stop the run in one line; Dask with a real scheduler."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from peaksim.corpus import in_process, make_corpus, on_dask, processes
from peaksim.corpus.spec import spec_to_json
from peaksim.errors import InputError, RendererError

from tests.peaksim.corpus import tasks
from tests.peaksim.corpus.helpers import child_environment, contents, is_alive, tiny_spec, wait_until


def test_in_process_keeps_the_order() -> None:
    assert list(in_process().run(tasks.square, range(5))) == [0, 1, 4, 9, 16]


def test_processes_do_everything_and_leave_nothing_behind() -> None:
    assert sorted(processes(2).run(tasks.square, range(20))) == [n * n for n in range(20)]
    assert list(processes(2).run(tasks.square, [])) == []
    import multiprocessing

    assert multiprocessing.active_children() == []


def test_a_killed_worker_is_replaced_and_its_task_done_again(tmp_path: Path) -> None:
    assert sorted(processes(2).run(partial(tasks.die_once, str(tmp_path)), range(8))) == list(range(8))
    assert (tmp_path / "died").exists()


def test_a_task_that_kills_every_worker_stops_the_run() -> None:
    with pytest.raises(RendererError, match="task 7: 3 worker processes died over it, the last with exit code -9"):
        list(processes(1).run(tasks.always_die, [7]))


def test_bad_input_in_a_worker_is_bad_input_here() -> None:
    with pytest.raises(InputError, match=r"^no 4$"):
        list(processes(1).run(tasks.refuse, [4]))


def test_a_fault_in_a_worker_shows_where_it_was() -> None:
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        list(processes(1).run(tasks.stumble, [0]))


def test_each_worker_has_one_thread_and_the_environment_is_put_back() -> None:
    before = dict(os.environ)
    assert set(processes(1).run(tasks.threads, [0])) == {"1,1,1"}
    assert dict(os.environ) == before


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a thread watches, which this worker does not let run")
def test_a_worker_dies_with_its_parent_whatever_it_does(tmp_path: Path) -> None:
    code = (
        "import sys; from functools import partial\n"
        "from peaksim.corpus import processes; from tests.peaksim.corpus import tasks\n"
        "list(processes(1).run(partial(tasks.hold_the_interpreter, sys.argv[1]), [0]))"
    )
    parent = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], env=child_environment())
    try:
        wait_until(lambda: (tmp_path / "pid").exists() and (tmp_path / "pid").read_text().endswith(" "))
    finally:
        parent.kill()
        parent.wait(10)
    worker = int((tmp_path / "pid").read_text())
    wait_until(lambda: not is_alive(worker), limit_s=20)
    assert not is_alive(worker)


@pytest.mark.parametrize("workers", [0, -1, 5000])
def test_a_foolish_number_of_workers_is_refused(workers: int) -> None:
    with pytest.raises(InputError, match=f"--workers: expected 1…1024, got {workers}"):
        processes(workers)


# --- Dask -----------------------------------------------------------------------------------------------------------

pytest.importorskip("distributed")


class Cluster:
    """A scheduler and workers as processes of their own on this machine."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.processes: list[subprocess.Popen[bytes]] = []
        file = folder / "scheduler.json"
        self._start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file))
        self.address = str(json.loads(self._await(file))["address"])

    def _await(self, file: Path) -> str:
        """Return the scheduler's file when it is written; a scheduler that does not come fails with its log."""
        deadline = time.monotonic() + 60
        while not file.exists() or not file.read_text():
            if self.processes[0].poll() is not None or time.monotonic() > deadline:
                self.stop()
                pytest.fail(f"no scheduler came: {(self.folder / 'log.txt').read_text()}")
            time.sleep(0.1)
        return file.read_text()

    def add_worker(self, *options: str) -> subprocess.Popen[bytes]:
        return self._start(
            "worker", self.address, "--no-dashboard", "--no-nanny", "--local-directory", str(self.folder), *options
        )

    def _start(self, *command: str) -> subprocess.Popen[bytes]:
        with (self.folder / "log.txt").open("ab") as log:
            arguments = [sys.executable, "-m", "dask", *command]
            process = subprocess.Popen(arguments, stdout=log, stderr=log, env=child_environment())
        self.processes.append(process)
        return process

    def stop(self) -> None:
        for process in reversed(self.processes):
            process.kill()
            process.wait(10)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    (tmp_path / "dask").mkdir()
    cluster = Cluster(tmp_path / "dask")
    yield cluster
    cluster.stop()


def test_a_worker_killed_midway_changes_nothing(folder: Path, tmp_path: Path, cluster: Cluster) -> None:
    spec = tiny_spec(frames=60)
    victim, _ = cluster.add_worker("--nthreads", "1"), cluster.add_worker("--nthreads", "1")
    killed: list[int] = []

    def kill_midway(frames: int) -> None:
        killed.append(frames)
        if sum(killed) > 12 and victim.poll() is None:
            victim.kill()

    made = make_corpus(spec, folder, str(tmp_path / "c"), on_dask(cluster.address), kill_midway)
    assert made.frames == 60
    assert victim.wait(60) == -signal.SIGKILL
    make_corpus(spec, folder, str(tmp_path / "whole"))
    assert contents(tmp_path / "c") == contents(tmp_path / "whole")


def test_a_scheduler_killed_midway_is_one_line_and_the_same_command_resumes(
    folder: Path, tmp_path: Path, cluster: Cluster
) -> None:
    """As a program, whose stderr shows what libraries print too."""
    spec = tiny_spec(frames=120)
    (tmp_path / "spec.json").write_text(spec_to_json(spec))
    cluster.add_worker("--nthreads", "1")
    code = (
        "from peakmark.cli.command import run_command; from tests.peaksim.corpus import helpers\n"
        "run_command(helpers.make_on_scheduler)"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "spec.json"), str(folder), str(tmp_path / "c")]
    program = subprocess.Popen([*command, cluster.address], env=child_environment(), stderr=subprocess.PIPE, text=True)
    try:
        wait_until(lambda: any((tmp_path / "c").glob("sums/*")) or program.poll() is not None)
        cluster.processes[0].kill()
        _, errors = program.communicate(timeout=120)
    finally:
        program.kill()
    assert errors == f"error: --dask {cluster.address}: the scheduler was lost; the same command resumes\n"
    assert program.returncode == 2
    assert make_corpus(spec, folder, str(tmp_path / "c")).rendered < 120
    make_corpus(spec, folder, str(tmp_path / "whole"))
    assert contents(tmp_path / "c") == contents(tmp_path / "whole")


def here(threads: int) -> Any:
    """Return a scheduler with one worker of so many threads, all in this process, which takes a tenth of the time."""
    from distributed import LocalCluster

    return LocalCluster(
        n_workers=1, threads_per_worker=threads, processes=False, protocol="tcp://", dashboard_address=None
    )


def test_workers_of_several_threads_are_refused() -> None:
    with (
        here(threads=3) as cluster,
        pytest.raises(InputError, match=r"expected workers of one thread .*, tcp://.* has 3"),
    ):
        list(on_dask(cluster.scheduler_address).run(tasks.square, [1]))


def test_bad_input_on_a_dask_worker_is_bad_input_here() -> None:
    with here(threads=1) as cluster, pytest.raises(InputError, match=r"^no 4$"):
        list(on_dask(cluster.scheduler_address).run(tasks.refuse, [4]))


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense", "tcp://"])
def test_a_scheduler_that_is_not_there_is_one_line(address: str) -> None:
    with pytest.raises(InputError, match=f"--dask {address}: expected a scheduler, none answers there"):
        list(on_dask(address).run(tasks.square, [1]))
