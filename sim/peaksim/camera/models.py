"""The cameras of the paper's figures, from data of their sensors and lenses."""

from dataclasses import dataclass

from peaksim.camera.camera import Camera, from_sensor
from peaksim.errors import SceneError


@dataclass(frozen=True)
class CameraModel:
    """A camera as its maker specifies it, zoomed out."""

    width: int
    """Of an image, px."""
    height: int
    """Of an image, px."""
    focal_mm: float
    """Focal length at the wide end."""
    sensor_width_mm: float
    """Width of the part of the sensor that the image covers."""


MODELS = {
    # not checked against a data sheet. Type 1/3.2" CCD of 4.54×3.42 mm;
    # the lens is a 35 mm equivalent of 35 mm over the diagonal (43.27 mm)
    "panasonic-dmc-fx1": CameraModel(2048, 1536, 35.0 * 5.684 / 43.27, 4.54),
    # ICX406 CCD, type 1/1.8", cells of 3.12 µm; lens of 7–21 mm
    "sony-dsc-s85": CameraModel(2272, 1704, 7.0, 2272 * 3.12e-3),
}
"""By name: the cameras of Figures 10 and 13."""


def camera_named(name: str, focal_mm: float | None = None) -> Camera:
    """Return a camera of `MODELS`, without distortion, at its wide end or at another focal length.

    Raises
    ------
    SceneError
        If there is no camera of that name.
    """
    if name not in MODELS:
        raise SceneError(f"camera: name: expected one of {', '.join(MODELS)}, got {name!r}")
    model = MODELS[name]
    return from_sensor(model.width, model.height, focal_mm or model.focal_mm, model.sensor_width_mm)
