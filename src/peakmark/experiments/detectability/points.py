"""What is measured: the axes of Section 4.1 and those beside them, as points of one condition each."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peakmark.detectors.registry import find_detector
from peakmark.errors import InputError
from peakmark.experiments.detectability.conditions import Condition
from peakmark.experiments.option import check_range
from peakmark.markers.patterns import SIFT_SIDE_IN_SIGMA

SURF_SIDE_PX = 147.0
"""Side of the SURF marker where it is not the axis (the paper's)."""

SIFT_SIGMA_PX = 15.0
"""σ of the SIFT marker where it is not the axis (the paper's)."""

SURF_KINDS = ("surf-dark", "surf-range-dark")
SIFT_KINDS = ("sift-dark", "sift-range-dark")
"""Markers that are measured. Light ones give the same key points: the negative of an image has the same extrema."""

PAPER_PX = 513
"""Side of the paper's images."""

MAP_TILTS_DEG = (0.0, 20.0, 40.0, 50.0, 60.0, 70.0)
MAP_NOISES = (0.0, 10.0)
MAP_POSITION_RANGE_PX = 8.0
"""What the map of sizes × tilts is measured at. The positions are random to the samples of octaves of this step."""

PAPER_EXPERIMENTS = ("scale", "turn", "tilt", "noise")
"""What Section 4.1 measures."""

OF_VLFEAT = ("scale", "turn", "bias", "background")
"""What VLFeat's SIFT takes part in over random phases, and with one image a point in all: it is four times as slow as
OpenCV's, and differs where that has seams between octaves."""

SURF_SEAMS_PX = (27.0, 55.0, 109.0)
SIFT_SEAMS_PX = (2.26, 4.53, 9.05, 18.1, 36.2)
"""Sizes where ditches are looked for: SURF sides half-way between two octaves of the paper's preset, 1.09·√(21·30) px
and doubled, and σ at the seams between SIFT's octaves, 1.6·2^(k + ½) px."""

_SURF_DETECTORS = ("surf-paper", "surf")
_MAPPED = {"surf-dark": _SURF_DETECTORS, "sift-dark": ("sift",), "sift-range-dark": ("sift", "surf")}
_SIFT_IMAGE_PX = 257
_TILTS_DEG = np.array([0, 15, 25, 30, 35, 40, 45, 50, 55, 60, 65, 70, 75, 80], float)
_NEAR_TILTS_DEG = np.array([0, 15, 25, 30, 35, 40, 45, 55, 65, 75, 80], float)


@dataclass(frozen=True)
class DetectabilityConfig:
    """How much to measure."""

    trials: int = 100
    """Random phases and rotations a point."""
    every: int = 1
    """Take each n-th value of every axis, and of sizes also those nearest to the seams; 1 takes all."""
    seed: int = 0
    """A drawing's stream derives from (seed, its scenery, the trial), an image's from (seed, its point, the trial)."""
    extra: tuple[str, ...] = ()
    """Further detectors by name, such as "cv2:ORB" or "module:function", for every point."""
    only: tuple[str, ...] = ()
    """Experiments to run, by name; none is all, or the paper's with `is_paper`."""
    is_paper: bool = False
    """One centred image a point, as the paper's figures have it, instead of random ones."""

    def __post_init__(self) -> None:
        check_range("trials", self.trials, 1)
        check_range("every", self.every, 1)
        check_range("seed", self.seed, 0)
        for name in self.only:
            if name not in EXPERIMENTS:
                raise InputError(f"--only: expected some of {', '.join(EXPERIMENTS)}, got {name!r}")
        for name in self.extra:
            find_detector(name)


@dataclass(frozen=True)
class Point:
    """One condition and its detectors."""

    experiment: str
    """Name in `EXPERIMENTS`."""
    x: float
    """Position on the experiment's axis."""
    condition: Condition
    detectors: tuple[str, ...]
    series: str = ""
    """What tells this point's curve from others of the same marker, such as "2 sides away"."""

    @property
    def name(self) -> str:
        """Unique among the points of a run; the random stream of its images derives from it."""
        return f"{self.experiment}/{self.condition.marker}/{self.series}/{self.x:g}"


def points(config: DetectabilityConfig) -> list[Point]:
    """Return all points of a configuration, experiment by experiment."""
    names = config.only or (PAPER_EXPERIMENTS if config.is_paper else tuple(EXPERIMENTS))
    with_vlfeat = names if config.is_paper else OF_VLFEAT
    chosen = [_with_vlfeat(point, with_vlfeat) for name in names for point in EXPERIMENTS[name](config.every)]
    as_in_paper: dict[str, Any] = {"is_centred": True, "image_px": PAPER_PX} if config.is_paper else {}
    return [
        replace(
            point,
            detectors=tuple(dict.fromkeys((*point.detectors, *config.extra))),
            condition=replace(point.condition, **as_in_paper),
        )
        for point in chosen
    ]


def undistorted(kind: str) -> Condition:
    """Return the condition of the paper's size and nothing else; the image holds the filters next to that size."""
    if kind.startswith("surf"):
        return Condition(kind, SURF_SIDE_PX)
    return Condition(kind, SIFT_SIGMA_PX * SIFT_SIDE_IN_SIGMA, _SIFT_IMAGE_PX)


def _markers(kinds: tuple[str, ...] = SURF_KINDS + SIFT_KINDS) -> Iterator[tuple[Condition, tuple[str, ...]]]:
    """Yield every marker's undistorted condition and its detectors."""
    for kind in kinds:
        yield undistorted(kind), _SURF_DETECTORS if kind in SURF_KINDS else ("sift",)


def _with_vlfeat(point: Point, experiments: Sequence[str]) -> Point:
    """Return the point, in these experiments, with VLFeat's SIFT, the paper's, beside OpenCV's, if it is installed."""
    if point.condition.marker != "sift-dark" or point.experiment not in experiments or not find_spec("pycolmap"):
        return point
    return replace(point, detectors=(*point.detectors, "vlfeat"))


def _along(
    experiment: str,
    field_name: str,
    values: NDArray[np.float64],
    series: str = "",
    kinds: tuple[str, ...] = SURF_KINDS + SIFT_KINDS,
    **fixed: Any,
) -> list[Point]:
    """Return the points of markers along one field of the condition."""
    return [
        Point(experiment, float(x), replace(condition, **fixed, **{field_name: x.item()}), detectors, series)
        for condition, detectors in _markers(kinds)
        for x in values
    ]


def _scale(every: int) -> list[Point]:
    """SURF sides 8…260 px, SIFT σ 1…60 px, binary markers at every other; some go to both detectors."""
    sides = _thinned(np.unique(np.rint(np.geomspace(8, 260, 54))), every, SURF_SEAMS_PX)
    sigmas = _thinned(np.round(np.geomspace(1, 60, 22), 2), every, SIFT_SEAMS_PX)
    surf = [
        Point("scale", float(s), _sized(kind, float(s)), _scale_detectors(kind, s))
        for kind, step in zip(SURF_KINDS, (1, 2), strict=True)
        for s in sides[::step]
    ]
    sift = [
        Point("scale", float(s), _sized(kind, SIFT_SIDE_IN_SIGMA * s), ("sift", "surf-paper"))
        for kind, step in zip(SIFT_KINDS, (1, 2), strict=True)
        for s in sigmas[::step]
    ]
    return surf + sift


def _thinned(sizes: NDArray[np.float64], every: int, seams: Sequence[float]) -> NDArray[np.float64]:
    """Return each n-th size, and those nearest to the seams."""
    nearest = [int(np.abs(np.log(sizes / seam)).argmin()) for seam in seams]
    return sizes[sorted({*range(0, len(sizes), every), *nearest})]


def _sized(kind: str, side_px: float) -> Condition:
    """Return the condition of a marker of a size, in an image that is just large enough."""
    return Condition(kind, side_px, _image_px(side_px))


def _scale_detectors(kind: str, side_px: float) -> tuple[str, ...]:
    """Return SURF, and SIFT for the binary SURF marker, whose response to SIFT is compared with the disc's."""
    also = ("sift",) if kind == "surf-range-dark" and side_px <= SURF_SIDE_PX else ()
    return (*_SURF_DETECTORS, *also)


def _image_px(side_px: float) -> int:
    """Return an odd side of an image that holds a marker and the filters next to its size; at most the paper's."""
    return min(max(129, int(1.4 * side_px) + 24), PAPER_PX) | 1


def _bias(every: int) -> list[Point]:
    """Return sizes of the DoG for OpenCV's SIFT, with its precise upscale and as it comes."""
    sigmas = np.array([4.0, 6.0, 9.0, 13.0])[::every]
    return [
        Point("bias", float(s), _sized("sift-dark", SIFT_SIDE_IN_SIGMA * s), ("sift", "sift-opencv")) for s in sigmas
    ]


def _tilt(every: int) -> list[Point]:
    """Return out-of-plane rotations, near and far; what perspective magnifies needs the whole image."""
    near = [
        point
        for distance in (1.0, 2.0, 5.0)
        for kinds, image_px in ((("surf-dark",), PAPER_PX), (("sift-dark",), 301))
        for point in _along(
            "tilt",
            "tilt_deg",
            _NEAR_TILTS_DEG[::every],
            sides_away(distance),
            kinds,
            distance_sides=distance,
            image_px=image_px if distance < 5 else undistorted(kinds[0]).image_px,
        )
    ]
    return near + _along("tilt", "tilt_deg", _TILTS_DEG[::every], sides_away(20.0), distance_sides=20.0)


def sides_away(distance: float) -> str:
    """Return the series of a distance in marker sides."""
    return f"{distance:g} side{'' if distance == 1 else 's'} away"


def _contrast(every: int) -> list[Point]:
    values = np.array([1, 0.7, 0.5, 0.35, 0.25, 0.18, 0.13, 0.1, 0.07, 0.05, 0.03])[::every]
    plain = _along("contrast", "contrast", values, "uniform")
    photo = _along("contrast", "contrast", values, "gravel", ("surf-dark",), background="gravel", image_px=PAPER_PX)
    return [*plain, *photo, *_along("contrast", "contrast", values, "gravel", ("sift-dark",), background="gravel")]


def _photographs(every: int) -> list[Point]:
    """Return the markers before photographs, by number: 1 gravel, 2 brick, 3 grass."""
    return [
        Point("background", float(number), replace(condition, background=name), detectors, name)
        for number, name in list(enumerate(("gravel", "brick", "grass"), 1))[:: min(every, 3)]
        for condition, detectors in _markers(("surf-dark", "sift-dark"))
    ]


def _vignetting(every: int) -> list[Point]:
    """Return smaller markers far from the image's middle, where light falls off."""
    values = np.array([0, 0.3, 0.6, 0.8, 0.95])[::every]
    off = {"off_axis_px": 190.0, "image_px": PAPER_PX, "side_px": 60.0}
    return _along("vignetting", "vignetting", values, "", ("surf-dark", "sift-dark"), **off)


def _map(every: int) -> list[Point]:
    """Return sides × tilts from afar, without and with noise: the operating envelope in metres is read from them."""
    sides = np.rint(np.geomspace(10, 210, 18))[::every]
    return [
        Point("map", float(side), _map_condition(kind, float(side), tilt, noise), detectors, map_series(tilt, noise))
        for kind, detectors in _MAPPED.items()
        for tilt in MAP_TILTS_DEG[::every]
        for side in sides
        for noise in MAP_NOISES
    ]


def _map_condition(kind: str, side_px: float, tilt_deg: float, noise: float) -> Condition:
    sized = _sized(kind, side_px)
    return replace(sized, tilt_deg=tilt_deg, noise=noise, position_range_px=MAP_POSITION_RANGE_PX)


def map_series(tilt_deg: float, noise: float) -> str:
    """Return the series of a tilt and a noise in the map."""
    return f"tilt {tilt_deg:g}°, noise {noise:g}"


def _axis(name: str, every: int) -> list[Point]:
    field_name, values = _AXES[name]
    return _along(name, field_name, np.asarray(values, dtype=int if name == "jpeg" else float)[::every])


def _noise(every: int) -> list[Point]:
    """Return noise over the whole image of the paper, where it competes with the marker."""
    values = np.arange(0.0, 101, 10)[::every]
    return _along("noise", "noise", values, image_px=PAPER_PX)


_AXES: dict[str, tuple[str, tuple[float, ...]]] = {
    "turn": ("turn_deg", tuple(range(0, 181, 15))),
    "jpeg": ("jpeg_quality", (100, 90, 75, 50, 30, 20, 10, 5, 2)),
    "defocus": ("defocus_px", (0, 2, 4, 6, 9, 12, 16, 20, 25, 30, 40)),
    "motion": ("motion_px", (0, 5, 10, 15, 20, 30, 40, 50, 60, 80)),
    "exposure": ("exposure", (0.05, 0.1, 0.2, 0.4, 0.7, 1, 1.4, 2, 3, 4)),
}
"""Experiments along one field of the condition: the field and its values."""

EXPERIMENTS: dict[str, Callable[[int], list[Point]]] = {
    "scale": _scale,
    "turn": partial(_axis, "turn"),
    "tilt": _tilt,
    "noise": _noise,
    "bias": _bias,
    "contrast": _contrast,
    **{name: partial(_axis, name) for name in ("jpeg", "defocus", "motion", "exposure")},
    "vignetting": _vignetting,
    "background": _photographs,
    "map": _map,
}
"""The experiments by name; each gives its points, of every n-th value."""
