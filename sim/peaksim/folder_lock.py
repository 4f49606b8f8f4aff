"""Locks of folders, which end with the process that holds them; nothing is left in the folder."""

import hashlib
import os
import sys
import tempfile
from pathlib import Path
from time import sleep

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

_STEP_S = 0.05  # between attempts where the system cannot wait


def lock_folder(folder: Path, *, wait: bool) -> int:
    """Lock a folder; return the descriptor to close (`os.close`) when done.

    Windows opens no folders: there a file of the user's temporary folder stands for it, so that only runs of one user
    on one machine exclude each other.

    Raises
    ------
    BlockingIOError
        If another run holds it and `wait` is False.
    OSError
        If it is no folder (a link is none), cannot be read, or its file system has no locks.
    """
    if sys.platform == "win32":
        if folder.is_symlink() or not folder.is_dir():
            raise NotADirectoryError(f"{folder}: expected a folder")
        name = hashlib.sha256(os.path.normcase(folder.resolve()).encode()).hexdigest()[:32]
        descriptor = os.open(Path(tempfile.gettempdir(), f"peakmark-{name}.lock"), os.O_RDWR | os.O_CREAT)
    else:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        _lock(descriptor, wait)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def _lock(descriptor: int, wait: bool) -> None:
    if sys.platform == "win32":
        while True:
            try:
                return msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
            except OSError as error:  # PermissionError: another process has it
                if not wait:
                    raise BlockingIOError(f"locked by another run: {error.strerror or error}") from error
            sleep(_STEP_S)
    else:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
