"""Cameras: the one projection that images and truth share.

Pixel centres are at integers: the image covers [−0.5, W − 0.5] × [−0.5, H − 0.5].
Distortion is OpenCV's: "brown" with (k1, k2, p1, p2[, k3[, k4, k5, k6[, s1, s2, s3, s4[, τx, τy]]]]), "fisheye" with
(k1, k2, k3, k4).
"""

import math
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Literal, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peaksim.camera.calibration_file import read_calibration, write_calibration
from peaksim.camera.thin_lens import ThinLens
from peaksim.errors import SceneError
from peaksim.native import function

Points = NDArray[np.float64]

MAX_PIXELS = 64_000_000
"""Pictures larger than this are refused: 64 megapixels."""

_COEFFICIENTS = {"brown": (0, 4, 5, 8, 12, 14), "fisheye": (0, 4)}
_DERIVED = cast(float, None)
"""Default of numbers that follow from others."""
_NEWTON_STEPS = 50
_CONVERGED = 1e-12
"""Newton's method for fisheyes ends when the last step is below this, in radians."""


_distort_brown = function(
    "void distort_brown(const f8[n,2] flat, const f8[14] terms, const f8[3,3]? tilt, f8 fold_radius, f8[n,2] out)"
)
_invert_brown = function(
    "void undistort_brown(const f8[n,2] images, const f8[14] terms, const f8[3,3]? tilt, f8 fold_radius, f8[n,2] out)"
)


@dataclass(frozen=True)
class Camera:
    """A camera: intrinsics, lens distortion and shutter."""

    width: int = 640
    """Pixels."""
    height: int = 480
    """Pixels."""
    fx: float = 500.0
    """Focal length along x, px."""
    fy: float = _DERIVED
    """Focal length along y, px; `fx` if it is not given."""
    cx: float = _DERIVED
    """Principal point, px; the image's middle, (width − 1)/2, if it is not given."""
    cy: float = _DERIVED
    """Principal point, px; the image's middle, (height − 1)/2, if it is not given."""
    distortion: tuple[float, ...] = ()
    """OpenCV's vector, in any shape that it returns: brown takes 0, 4, 5, 8, 12 or 14 coefficients, fisheye 0 or 4."""
    model: Literal["brown", "fisheye"] = "brown"
    """Lens model; without coefficients brown is the pinhole and fisheye the equidistant lens."""
    row_time_s: float = 0.0
    """Rolling shutter: time from one row's exposure to the next one's; 0 exposes all rows at once."""
    exposure_s: float = 0.0
    """Time over which a moving camera integrates its image."""
    thin_lens: ThinLens | None = None
    """Depth of field, drawn by the traced renderer; None is in focus everywhere."""

    def __post_init__(self) -> None:
        _check_size(self.width, self.height)
        derived = {"fy": self.fx, "cx": (self.width - 1) / 2, "cy": (self.height - 1) / 2}
        for name in ("fx", "fy", "cx", "cy", "row_time_s", "exposure_s"):
            given = getattr(self, name)
            object.__setattr__(self, name, _number(derived[name] if given is None and name in derived else given, name))
        object.__setattr__(self, "distortion", _coefficients(self.distortion))
        _check_numbers(self)
        if self.model not in _COEFFICIENTS:
            raise SceneError(f'camera: model: expected "brown" or "fisheye", got {self.model!r}')
        if len(self.distortion) not in _COEFFICIENTS[self.model]:
            raise SceneError(
                f"camera: distortion: expected one of {_COEFFICIENTS[self.model]} coefficients "
                f"for {self.model}, got {len(self.distortion)}"
            )
        if self.distortion and not np.isfinite(self.unproject(self.border())).all():
            raise SceneError(
                f"camera: distortion: expected a lens that can be inverted over the whole image, "
                f"got {self.distortion}, which folds it"
            )

    @classmethod
    def load(cls, path: str | Path) -> "Camera":
        """Read a calibration of OpenCV (YAML, XML, JSON), ROS (camera_info), Kalibr (camchain), COLMAP or a corpus.

        FILE#NAME chooses one camera of a file that has several. See `calibration_file` for what is read.

        Raises
        ------
        InputError, SceneError
            One line that names the file, what was expected and what came.
        """
        fields = read_calibration(path)
        try:
            return cls(**fields)
        except SceneError as error:
            raise SceneError(f"{path}: {error}") from error

    def save(self, path: str | Path, name: str = "camera", format: str | None = None) -> None:
        """Write size, intrinsics and lens, not the shutter, as a calibration that others read.

        The format is "opencv" for names ending in .yaml, .yml, .xml or .json, "colmap" for .txt, unless given: also
        "ros" (camera_info) and "kalibr" (camchain). Numbers are written in full.

        Raises
        ------
        InputError
            If the format is unknown, follows from no ending, or has no model of this lens.
        """
        write_calibration(asdict(self), Path(path), name, format)

    @property
    def matrix(self) -> NDArray[np.float64]:
        """(3, 3) OpenCV camera matrix."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1]], dtype=np.float64)

    @property
    def focal_px(self) -> float | None:
        """Mean focal length; None of a fisheye, whose scale is no pinhole's away from its middle."""
        return math.sqrt(self.fx * self.fy) if self.model == "brown" else None

    @property
    def is_pinhole(self) -> bool:
        """Whether straight lines stay straight."""
        return self.model == "brown" and not any(self.distortion)

    def project(self, points_in_camera: ArrayLike) -> Points:
        """Return (n, 2) px of (n, 3) points in metres, camera frame; nan behind the camera.

        Brown sees z > 0, up to the radius where the lens would fold the image; fisheye sees every direction
        except straight behind.
        """
        points = np.asarray(points_in_camera, dtype=np.float64).reshape(-1, 3)
        flat = (
            _project_brown(points, self.distortion)
            if self.model == "brown"
            else _project_fisheye(points, self.distortion)
        )
        return np.asarray(flat * [self.fx, self.fy] + [self.cx, self.cy])

    def unproject(self, xy: ArrayLike) -> Points:
        """Return (n, 3) viewing directions of (n, 2) px: z = 1 for brown, unit length for fisheye.

        nan where no direction projects to (beyond the fold of a distortion).
        """
        flat = (np.asarray(xy, dtype=np.float64).reshape(-1, 2) - [self.cx, self.cy]) / [self.fx, self.fy]
        if self.model == "fisheye":
            return _unproject_fisheye(flat, self.distortion)
        undistorted = _undistort_brown(flat, self.distortion) if any(self.distortion) else flat
        return np.concatenate([undistorted, np.ones((len(flat), 1))], axis=1)

    def contains(self, xy: Points) -> NDArray[np.bool_]:
        """Return (n,) which of (n, 2) px are in the image; nan is not."""
        return np.asarray(((xy >= -0.5) & (xy <= [self.width - 0.5, self.height - 0.5])).all(axis=1))

    def pixel_centers(self) -> Points:
        """Return the (H, W, 2) px of all pixel centres."""
        return np.stack(np.meshgrid(np.arange(self.width), np.arange(self.height)), axis=2).astype(np.float64)

    def border(self) -> Points:
        """Return 260 points (n, 2) px along the image's border, 65 a side, where a distortion folds first."""
        x = np.linspace(-0.5, self.width - 0.5, 65)
        y = np.linspace(-0.5, self.height - 0.5, 65)
        sides = [np.stack([x, np.full(65, end)], axis=1) for end in y[[0, -1]]]
        return np.concatenate([*sides, *(np.stack([np.full(65, end), y], axis=1) for end in x[[0, -1]])])


def from_sensor(
    width: int, height: int, focal_mm: float, sensor_width_mm: float, *, distortion: tuple[float, ...] = ()
) -> Camera:
    """Return a camera with square pixels and a centred principal point from lens and sensor data.

    Sizes are px, lengths mm; `distortion` is OpenCV's vector, none by default.

    Raises
    ------
    SceneError
        If a length is not positive.
    """
    if not (focal_mm > 0 and sensor_width_mm > 0):
        raise SceneError(
            f"camera: expected positive millimetres, got focal_mm {focal_mm}, sensor_width_mm {sensor_width_mm}"
        )
    focal = focal_mm / sensor_width_mm * width
    return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, distortion)


def resized(camera: Camera, scale: float) -> Camera:
    """Return the camera with `scale` times as many pixels along each side, rounded, and the same field of view."""
    width, height = round(camera.width * scale), round(camera.height * scale)
    sx, sy = width / camera.width, height / camera.height
    return replace(
        camera,
        width=width,
        height=height,
        fx=camera.fx * sx,
        fy=camera.fy * sy,
        cx=(camera.cx + 0.5) * sx - 0.5,
        cy=(camera.cy + 0.5) * sy - 0.5,
    )


def _check_size(width: int, height: int) -> None:
    for name, value in (("width", width), ("height", height)):
        if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < 1:
            raise SceneError(f"camera: {name}: expected a whole number of pixels ≥ 1, got {value!r}")
    if int(width) * int(height) > MAX_PIXELS:
        raise SceneError(f"camera: expected at most {MAX_PIXELS} pixels, got {width}×{height}")


def _number(value: ArrayLike, name: str) -> float:
    """Return a finite number, also one in an array of a single element."""
    try:
        number = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        number = np.empty(0)
    if number.size != 1 or not np.isfinite(number).all():
        raise SceneError(f"camera: {name}: expected a finite number, got {value!r}")
    return float(number.item())


def _coefficients(distortion: ArrayLike | None) -> tuple[float, ...]:
    """Return OpenCV's vector (n,), (1, n) or (n, 1) as plain numbers; None is none."""
    try:
        values = np.asarray(() if distortion is None else distortion, dtype=np.float64)
    except (TypeError, ValueError):
        raise SceneError(f"camera: distortion: expected numbers, got {distortion!r}") from None
    if values.ndim != 1 and (values.ndim != 2 or 1 not in values.shape):
        raise SceneError(f"camera: distortion: expected OpenCV's vector, got an array of shape {values.shape}")
    if not np.isfinite(values).all():
        raise SceneError(f"camera: distortion: expected finite numbers, got {tuple(values.ravel().tolist())}")
    return tuple(values.ravel().tolist())


def _check_numbers(camera: Camera) -> None:
    for name in ("fx", "fy"):
        if not getattr(camera, name) > 0:
            raise SceneError(f"camera: {name}: expected a positive focal length in px, got {getattr(camera, name)}")
    for name in ("row_time_s", "exposure_s"):
        if getattr(camera, name) < 0:
            raise SceneError(f"camera: {name}: expected a time ≥ 0 s, got {getattr(camera, name)}")


def _brown_terms(distortion: tuple[float, ...]) -> list[float]:
    return [*distortion, *(14 - len(distortion)) * (0.0,)]


@lru_cache(maxsize=64)
def _sensor_tilt(distortion: tuple[float, ...]) -> NDArray[np.float64] | None:
    """Return the (3, 3) homography from the plane across the optical axis to the tilted sensor; None without tilt."""
    tilt_x, tilt_y = _brown_terms(distortion)[12:]
    if not (tilt_x or tilt_y):
        return None
    (cx, cy), (sx, sy) = np.cos([tilt_x, tilt_y]), np.sin([tilt_x, tilt_y])
    about_x = np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    about_y = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    rotation = about_y @ about_x
    onto_sensor = np.array([[rotation[2, 2], 0, -rotation[0, 2]], [0, rotation[2, 2], -rotation[1, 2]], [0, 0, 1]])
    return np.asarray(onto_sensor @ rotation)


@lru_cache(maxsize=64)
def _fold_radius(distortion: tuple[float, ...]) -> float:
    """Return the radius (tan of the angle) at which the radial part of a brown lens folds back; inf if never."""
    k1, k2, _, _, k3, k4, k5, k6 = _brown_terms(distortion)[:8]
    top, bottom = np.polynomial.Polynomial([1, k1, k2, k3]), np.polynomial.Polynomial([1, k4, k5, k6])
    r2 = np.polynomial.Polynomial([0, 1])
    # d/dr of r·top/bottom, in r²; and the poles of the quotient
    slope = top * bottom + 2 * r2 * (top.deriv() * bottom - top * bottom.deriv())
    roots = np.concatenate([slope.roots(), bottom.roots()])
    real = roots[np.abs(roots.imag) < 1e-9 * np.maximum(1, np.abs(roots))].real if len(roots) else roots
    return float(np.sqrt(min((r for r in real if r > 0), default=np.inf)))


def _project_brown(points: Points, distortion: tuple[float, ...]) -> Points:
    z = points[:, 2]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        flat = np.where(z[:, None] > 0, points[:, :2] / z[:, None], np.nan)
    if not any(distortion):
        return flat
    terms, distorted = np.array(_brown_terms(distortion)), np.empty_like(flat)
    _distort_brown(flat, terms, _sensor_tilt(distortion), _fold_radius(distortion), distorted)
    return distorted


def _undistort_brown(distorted: Points, distortion: tuple[float, ...]) -> Points:
    """Invert the distortion by Newton's method from the image centre outwards; nan where it has no inverse."""
    terms, flat, tilt = np.array(_brown_terms(distortion)), np.empty_like(distorted), _sensor_tilt(distortion)
    untilt = None if tilt is None else np.linalg.inv(tilt)
    _invert_brown(distorted, terms, untilt, _fold_radius(distortion), flat)
    return flat


def _fisheye_angle(
    theta: NDArray[np.float64], distortion: tuple[float, ...]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the distorted angle and its derivative (Kannala and Brandt 2006, as OpenCV's fisheye)."""
    k1, k2, k3, k4 = np.pad(np.asarray(distortion, dtype=np.float64), (0, 4 - len(distortion)))
    t2 = theta * theta
    value = theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
    return value, 1 + t2 * (3 * k1 + t2 * (5 * k2 + t2 * (7 * k3 + t2 * 9 * k4)))


def _project_fisheye(points: Points, distortion: tuple[float, ...]) -> Points:
    radius = np.hypot(points[:, 0], points[:, 1])
    theta = np.arctan2(radius, points[:, 2])
    angle, _ = _fisheye_angle(theta, distortion)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(radius > 0, angle / radius, 1 / points[:, 2])
    flat = points[:, :2] * scale[:, None]
    flat[(radius == 0) & ~(points[:, 2] > 0) | (theta >= _fisheye_limit(distortion))] = np.nan
    return flat


@lru_cache(maxsize=64)
def _fisheye_limit(distortion: tuple[float, ...]) -> float:
    """Return the angle at which a fisheye lens folds back, at most a little below π."""
    k = np.pad(np.asarray(distortion, dtype=np.float64), (0, 4 - len(distortion)))
    roots = np.polynomial.Polynomial([1, *(k * [3, 5, 7, 9])]).roots() if k.any() else np.empty(0)
    real = roots[np.abs(roots.imag) < 1e-9 * np.maximum(1, np.abs(roots))].real if len(roots) else roots
    folds = np.sqrt(np.asarray(real, dtype=np.float64)[np.asarray(real) > 0])
    return float(min([np.pi * (1 - 1e-9), *folds.tolist()]))


def _unproject_fisheye(flat: Points, distortion: tuple[float, ...]) -> Points:
    angle = np.hypot(flat[:, 0], flat[:, 1])
    limit = _fisheye_limit(distortion)
    theta = np.minimum(angle, 0.99 * limit)
    with np.errstate(all="ignore"):
        for _ in range(_NEWTON_STEPS):
            value, slope = _fisheye_angle(theta, distortion)
            step = (angle - value) / slope
            theta = np.clip(theta + step, 0, limit)
            if not (np.abs(step) > _CONVERGED).any():
                break
        value, _ = _fisheye_angle(theta, distortion)
        theta[~(np.abs(value - angle) < 1e-9) | (theta >= limit)] = np.nan
        sine = np.where(angle > 0, np.sin(theta) / angle, 1.0)
    return np.stack([flat[:, 0] * sine, flat[:, 1] * sine, np.cos(theta)], axis=1)
