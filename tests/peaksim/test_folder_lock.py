"""Locks of folders: one holder, freed with the descriptor or the process; no links."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from peaksim.folder_lock import lock_folder

from tests.peaksim.corpus.helpers import child_environment

HOLD = "import sys; from pathlib import Path; from peaksim.folder_lock import lock_folder\n"
HOLD += "lock_folder(Path(sys.argv[1]), wait=True); print('held', flush=True); sys.stdin.read()"


def test_one_holds_it_until_it_is_closed(tmp_path: Path) -> None:
    first = lock_folder(tmp_path, wait=False)
    with pytest.raises(BlockingIOError):
        lock_folder(tmp_path, wait=False)
    os.close(first)
    os.close(lock_folder(tmp_path, wait=True))
    assert list(tmp_path.iterdir()) == []


def test_a_killed_process_frees_it(tmp_path: Path) -> None:
    pipe = subprocess.PIPE
    environment = {**os.environ, **child_environment()}
    holder = subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], stdin=pipe, stdout=pipe, env=environment)
    assert holder.stdout is not None
    assert holder.stdout.readline() == b"held\n"
    with pytest.raises(BlockingIOError):
        lock_folder(tmp_path, wait=False)
    holder.kill()
    holder.communicate()
    os.close(lock_folder(tmp_path, wait=False))


def test_links_and_files_are_no_folders(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    (tmp_path / "link").symlink_to(tmp_path)
    for name in ("file", "link", "nothing"):
        with pytest.raises(OSError, match=name):
            lock_folder(tmp_path / name, wait=False)
