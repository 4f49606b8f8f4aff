"""CPU time of the stages of `identify(image)`, on one thread: `python benchmarks/identify_stages.py IMAGE…`.

Medians over the images, of each the least of some rounds. Alignments are those of the first batch that pass the screen;
what identification takes beyond it is "more batches, decision, last fits".
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from time import process_time

import numpy as np
from numpy.typing import NDArray
from peaksim.image_file import read_image
from rich.console import Console
from rich.table import Table

from peakmark import identify
from peakmark.identification.alignment import correlations, noise_sigma_of
from peakmark.identification.candidates import candidate_pages
from peakmark.identification.general import USUAL, align_image
from peakmark.keypoints.image import as_gray
from peakmark.parallel import threads


def stage_times(gray: NDArray[np.uint8], rounds: int) -> dict[str, float]:
    """Return the CPU milliseconds of each stage on a grey image."""
    found = next(iter(candidate_pages(gray)))

    def correlate() -> None:
        for variant in USUAL:
            own = found[np.flatnonzero(found.signs == (1 if variant.polarity == "dark" else -1))]
            correlations(gray, own.xy, own.sides_px, variant)

    candidates = least_ms(lambda: next(iter(candidate_pages(gray))), rounds)
    noise, coarse = least_ms(lambda: noise_sigma_of(gray), rounds), least_ms(correlate, rounds)
    first_batch, everything = (
        least_ms(lambda: align_image(gray, is_screened=True), rounds),
        least_ms(lambda: identify(gray), rounds),
    )
    return {
        "noise": noise,
        "candidates: blobs of five shapes": candidates,
        "coarse correlation": coarse,
        "alignments, measures, evidence": first_batch - noise - candidates - coarse,
        "more batches, decision, last fits": everything - first_batch,
        "identify": everything,
    }


def least_ms(work: Callable[[], object], rounds: int) -> float:
    """Return the least CPU milliseconds of some rounds."""
    times = []
    for _ in range(rounds):
        start = process_time()
        work()
        times.append(1e3 * (process_time() - start))
    return min(times)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("images", nargs="+", type=Path)
    parser.add_argument("--rounds", type=int, default=5)
    asked = parser.parse_args()
    with threads(1):
        times = [stage_times(as_gray(read_image(path)), asked.rounds) for path in asked.images]
    table = Table("stage", "CPU ms, median", "largest", title=f"{len(times)} images, one thread")
    for name in times[0]:
        column = [each[name] for each in times]
        table.add_row(name, f"{np.median(column):.1f}", f"{max(column):.1f}")
    Console().print(table)


if __name__ == "__main__":
    main()
