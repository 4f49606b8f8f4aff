"""How every experiment gets through its items: those that its journal has are not done again, the others as they come.

Items are independent of each other; a record depends on the configuration and the item alone, so that neither the
number of workers nor an interruption changes it.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from peaksim.corpus.backends import in_process, processes

from peakmark.experiments.journal import Journal

OnStep = Callable[[int, int], None]
"""Called with the numbers of finished and of all items: once before the first, and after each that is done."""


def run_items(
    journal: Journal,
    names: Sequence[str],
    work: Callable[[int], Any],
    workers: int = 1,
    on_step: OnStep = lambda done, of: None,
) -> list[Any]:
    """Return the records of all items, in the order of their names.

    Parameters
    ----------
    journal
        Keeps each record as soon as there is one.
    names
        Of the items, each once.
    work
        Makes a record, plain values, from an index into `names`; one that any process can import where `workers` is
        not 1.
    workers
        Processes; 1 works in this one.
    on_step
        Called with the numbers of finished and of all items.

    Raises
    ------
    InputError
        If the number of workers is not in 1…1024, and what `work` raises.
    """
    missing = [index for index, name in enumerate(names) if name not in journal.records]
    backend = in_process() if workers == 1 else processes(workers)
    done = len(names) - len(missing)
    on_step(done, len(names))
    for index, record in backend.run(partial(_numbered, work), missing):
        journal.add(names[index], record)
        done += 1
        on_step(done, len(names))
    return [journal.records[name] for name in names]


def _numbered(work: Callable[[int], Any], index: int) -> tuple[int, Any]:
    return index, work(index)
