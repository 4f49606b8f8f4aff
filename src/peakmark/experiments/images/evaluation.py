"""A folder of images through `identify`, `decode_arrays` and the peers: outcomes, and their rates by group."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from typing import get_args

import numpy as np

from peakmark.experiments.images.outcome import ImageOutcome, evaluate_image
from peakmark.experiments.images.peers import PEERS, open_peer
from peakmark.experiments.images.truth import USUAL, Sought, TrueImage, read_set
from peakmark.experiments.journal import Journal
from peakmark.experiments.run import OnStep, run_items
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity
from peakmark.plain import from_plain
from peakmark.score.statistics import Quantiles, Rate, quantiles, rate
from peakmark.score.wanted import SMALLEST_PX

LEAST_PX = 15.0
"""Side from which markers and tags are counted; most groups hold those of `SMALLEST_PX` and more."""

SIDES_PX = (15.0, 20.0, 30.0, 45.0, 70.0, 150.0, np.inf)
TILTS_DEG = (0.0, 30.0, 45.0, 60.0, 78.0)
"""Edges of the groups by side and by tilt, the lower in the group."""

IDENTIFY = "identify"
"""What our own detector is called in tables."""


@dataclass(frozen=True)
class Item:
    """A marker or tag that a detector was to find."""

    detector: str
    """`IDENTIFY` for markers, a peer for tags."""
    side_px: float
    tilt_deg: float
    polarity: str
    limit: str
    """"" for tags."""
    paper: str
    condition: str
    sensor: str
    """See `TrueImage` and `MarkerOutcome`."""
    is_found: bool


@dataclass(frozen=True)
class Row:
    """The share of one group that each detector found."""

    group: str
    """Such as "tilt 30…45°"."""
    found: dict[str, Rate]
    """By detector: of markers by `IDENTIFY`, of tags by peers."""


@dataclass(frozen=True)
class Evaluation:
    """What was found in a folder of images."""

    images: int
    images_with_markers: int
    rows: tuple[Row, ...]
    """By group; only those that hold a marker or a tag."""
    arrays_read: Rate
    """Of arrays whose markers are whole, flat and 20 px and more."""
    wrong_codes: int
    """Codes read where another one hangs, or none."""
    wrong_polarities: int
    false_detections: dict[str, Rate]
    """Images that hold one, among those with markers and those without."""
    false_tags: dict[str, int]
    """Tags that are not there, by peer, in all images."""
    error_px: dict[str, Quantiles]
    """Of centres, by detector."""
    error_px_rms: dict[str, float | None]
    cpu_ms: dict[str, Quantiles]
    """An image, by detector."""


def evaluate_folder(
    folder: Path,
    peers: Sequence[str],
    journal: Journal,
    workers: int = 1,
    on_step: OnStep = lambda done, of: None,
    sought: Sought = USUAL,
) -> list[ImageOutcome]:
    """Return the outcome of every image of a folder, see `read_set`; an interrupted run resumes from its journal.

    Raises
    ------
    InputError
        If the folder, its truth or a peer is not as it must be.
    """
    for name in peers:
        open_peer(name)
    images = read_set(folder, sought).images
    names = [f"{k} {image.file}" for k, image in enumerate(images)]
    records = run_items(journal, names, partial(_outcome, folder, tuple(peers), sought), workers, on_step)
    return [from_plain(ImageOutcome, record) for record in records]


def _outcome(folder: Path, peers: Sequence[str], sought: Sought, index: int) -> ImageOutcome:
    known = _opened(folder, sought)
    return evaluate_image(known.images[index], known.read(index), peers, sought)


_opened = cache(read_set)
"""A folder's images, whose truth is read once a process."""


def summarise(images: Sequence[TrueImage], outcomes: Sequence[ImageOutcome]) -> Evaluation:
    """Return the figures of outcomes, one an image."""
    pairs = list(zip(images, outcomes, strict=True))
    marked = [outcome for outcome in outcomes if outcome.markers]
    bare = [outcome for outcome in outcomes if not outcome.markers]
    flat = [m for o in outcomes for m in o.markers if m.paper == "flat" and m.side_px >= LEAST_PX]
    arrays = [a for o in outcomes for a in o.arrays]
    whole = [a for a in arrays if a.is_whole and a.side_px >= SMALLEST_PX]
    errors = {IDENTIFY: [m.error_px for m in flat if m.error_px is not None]}
    for peer in _peers(outcomes):
        errors[peer] = [e for o in outcomes for t in o.tags if (e := t.error_px[peer]) is not None]
    return Evaluation(
        images=len(outcomes),
        images_with_markers=len(marked),
        rows=rows_of(list(items_of(pairs))),
        arrays_read=rate(sum(a.read == (a.code,) for a in whole), len(whole)),
        wrong_codes=sum(code != a.code for a in arrays for code in a.read) + sum(o.false_codes for o in outcomes),
        wrong_polarities=sum(m.is_wrong for m in flat),
        false_detections={
            name: rate(sum(bool(o.false_xy) for o in those), len(those))
            for name, those in (("with markers", marked), ("without", bare))
        },
        false_tags={peer: sum(o.false_tags[peer] for o in outcomes) for peer in _peers(outcomes)},
        error_px={name: quantiles(values) for name, values in errors.items()},
        error_px_rms={name: float(np.sqrt(np.mean(np.square(v)))) if v else None for name, v in errors.items()},
        cpu_ms={name: quantiles([1e3 * o.cpu_s[name] for o in outcomes]) for name in outcomes[0].cpu_s},
    )


def _peers(outcomes: Sequence[ImageOutcome]) -> list[str]:
    return [name for name in PEERS if name in outcomes[0].false_tags]


def items_of(pairs: Iterable[tuple[TrueImage, ImageOutcome]]) -> Iterator[Item]:
    """Yield every marker and, by peer, every tag that counts."""
    for image, outcome in pairs:
        where = (image.condition, image.sensor)
        for m in outcome.markers:
            yield Item(IDENTIFY, m.side_px, m.tilt_deg, m.polarity, m.limit, m.paper, *where, m.is_found)
        for tag in outcome.tags:
            for peer, error in tag.error_px.items():
                paper = "flat" if tag.is_whole else "cut"
                yield Item(peer, tag.side_px, tag.tilt_deg, "", "", paper, *where, error is not None)


def rows_of(items: Sequence[Item]) -> tuple[Row, ...]:
    """Return the groups that hold anything: all, by size, tilt, polarity, condition and sensor, then other paper."""
    counted = [item for item in items if item.side_px >= LEAST_PX]
    flat = [item for item in counted if item.paper == "flat"]
    big = [item for item in flat if item.side_px >= SMALLEST_PX]
    groups = {f"{LEAST_PX:g} px and more": flat, f"{SMALLEST_PX:g} px and more": big}
    for low, high in pairwise(SIDES_PX):
        name = f"side {low:g}…{high:g} px" if np.isfinite(high) else f"side {low:g} px and more"
        groups[name] = [item for item in flat if low <= item.side_px < high]
    for low, high in pairwise(TILTS_DEG):
        groups[f"tilt {low:g}…{high:g}°"] = [item for item in big if low <= item.tilt_deg < high]
    for polarity in get_args(Polarity):
        groups[f"{polarity} markers"] = [item for item in big if item.polarity == polarity]
    if any(item.limit == "range" for item in big):
        for limit in get_args(Limit):
            groups[f"limit {limit}"] = [item for item in big if item.limit == limit]
    for condition in sorted({item.condition for item in big}):
        groups[f"condition {condition}"] = [item for item in big if item.condition == condition]
    for sensor in sorted({item.sensor for item in big}):
        groups[f"sensor {sensor}"] = [item for item in big if item.sensor == sensor]
    for paper, name in (("bent", "bent paper"), ("covered", "covered by 3…50 %")):
        groups[name] = [item for item in counted if item.paper == paper]
    return tuple(Row(name, _rates(those)) for name, those in groups.items() if those)


def _rates(items: Sequence[Item]) -> dict[str, Rate]:
    """Return the share that was found, by detector."""
    detectors = list(dict.fromkeys(item.detector for item in items))
    by = {name: [item.is_found for item in items if item.detector == name] for name in detectors}
    return {name: rate(sum(found), len(found)) for name, found in by.items()}
