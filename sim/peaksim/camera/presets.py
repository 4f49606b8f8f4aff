"""Cameras by name, for scene files, corpora and commands; docs/reference/sensors.md shows each."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from peaksim.camera.sensor import Sensor
from peaksim.errors import SceneError

PRESETS: Mapping[str, Sensor] = MappingProxyType(
    {
        # pixels of 3.45 µm of a global shutter (10 000 e, 2.3 e of read noise), monochrome, straight from the converter
        "machine-vision-linear": Sensor(
            name="machine-vision-linear", lens_blur_px=0.5, vignetting=0.1, full_well_e=10_000, read_noise=0.06
        ),
        # pixels of 1.4 µm (6 000 e, 2 e) at twice the base sensitivity, developed for a pleasing look
        "phone": Sensor(
            name="phone",
            lens_blur_px=0.6,
            chromatic_aberration_px=0.4,
            vignetting=0.25,
            auto_exposure=70.0,
            adaptation_s=0.5,
            exposure=0.5,
            mosaic="rggb",
            full_well_e=6_000,
            gain=2.0,
            read_noise=0.17,
            tone="s-curve",
            sharpening=0.8,
            sharpening_px=1.0,
            jpeg_quality=90,
        ),
        # pixels of 2 µm (8 000 e, 4 e) with a sixteenth of the light that they need
        "webcam-low-light": Sensor(
            name="webcam-low-light",
            lens_blur_px=0.8,
            chromatic_aberration_px=0.6,
            vignetting=0.35,
            auto_exposure=70.0,
            adaptation_s=1.0,
            exposure=0.0625,
            mosaic="bggr",
            full_well_e=8_000,
            gain=16.0,
            hot_pixels=2e-4,
            read_noise=2.0,
            tone="srgb",
            sharpening=0.5,
            sharpening_px=1.2,
            jpeg_quality=75,
        ),
        # pixels of 4 µm (40 000 e, 3 e) at base sensitivity behind a good lens
        "dslr": Sensor(
            name="dslr",
            lens_blur_px=0.45,
            chromatic_aberration_px=0.2,
            vignetting=0.15,
            auto_exposure=70.0,
            mosaic="rggb",
            full_well_e=40_000,
            read_noise=0.02,
            tone="s-curve",
            sharpening=0.4,
            sharpening_px=0.8,
            jpeg_quality=95,
        ),
    }
)
"""Sensors that stand for kinds of cameras, chosen from data sheets of such pixels; none is fitted to one product."""


def sensor_named(name: str, **changes: Any) -> Sensor:
    """Return a preset, with some of its fields changed.

    Raises
    ------
    SceneError
        If there is no preset of that name, or a field is out of its range.
    """
    if name not in PRESETS:
        raise SceneError(f"sensor.preset: expected one of {', '.join(PRESETS)}, got {name!r}")
    return replace(PRESETS[name], **changes)
