"""`[sensor]` of a corpus file: how the settings of sensors vary."""

from typing import Any, Literal, Self

from pydantic import SerializerFunctionWrapHandler, model_serializer, model_validator

from peaksim.camera.presets import sensor_named
from peaksim.camera.sensor import WHOLE, Sensor
from peaksim.corpus.spread import Spread
from peaksim.errors import SceneError
from peaksim.scene.schema import StrictTable

_LATER = frozenset(
    ("presets", "chromatic_aberration_px", "auto_exposure", "mosaic", "hot_pixels", "hot_seed", "tone", "sharpening")
) | {"sharpening_px"}
"""Fields of `SensorSpread` that came after suites with baselines."""


class SensorSpread(StrictTable):
    """`[sensor]`: fields of `peaksim.camera.Sensor`; unset fields stay those of the preset, else the scene's."""

    per: Literal["frame", "sequence"] = "frame"
    presets: tuple[str, ...] | None = None
    lens_blur_px: Spread | None = None
    defocus_px: Spread | None = None
    chromatic_aberration_px: Spread | None = None
    vignetting: Spread | None = None
    auto_exposure: Spread | None = None
    exposure: Spread | None = None
    mosaic: tuple[str, ...] | None = None
    full_well_e: Spread | None = None
    gain: Spread | None = None
    hot_pixels: Spread | None = None
    hot_seed: Spread | None = None
    read_noise: Spread | None = None
    tone: tuple[str, ...] | None = None
    gamma: Spread | None = None
    sharpening: Spread | None = None
    sharpening_px: Spread | None = None
    bits: Spread | None = None
    jpeg_quality: Spread | None = None

    @property
    def spreads(self) -> dict[str, Spread]:
        """Field name → spread of the numbers that are set."""
        return {name: value for name, value in self if isinstance(value, Spread)}

    @property
    def choices(self) -> dict[str, tuple[str, ...]]:
        """Field name → words to draw from, of those that are set."""
        return {name: value for name in ("mosaic", "tone") if (value := getattr(self, name)) is not None}

    @model_serializer(mode="wrap")
    def _values(self, to_values: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Return the values without later fields that nobody stated, so that the hashes of older suites stay."""
        return {name: value for name, value in to_values(self).items() if name not in _LATER or value is not None}

    @model_validator(mode="after")
    def _in_range(self) -> Self:
        for name, values in self.spreads.items():
            if name in WHOLE and not values.is_whole:
                raise ValueError(f"{name}: expected whole numbers: one, integers = [low, high] or a choice of them")
            try:
                for limit in values.limits:
                    Sensor(**{name: sensor_value(name, limit)})  # type: ignore[arg-type]
            except SceneError as error:
                raise ValueError(str(error).removeprefix("sensor.")) from error
        for name, words in (("presets", self.presets), *self.choices.items()):
            if words is not None and not words:
                raise ValueError(f"{name}: expected at least one, got none")
            try:
                for word in words or ():
                    sensor_named(word) if name == "presets" else Sensor(**{name: word})  # type: ignore[arg-type]
            except SceneError as error:
                raise ValueError(str(error).removeprefix("sensor.")) from error
        return self


def sensor_value(name: str, value: float) -> int | float:
    """Return a sensor field's value in the type that `Sensor` takes."""
    return int(value) if name in WHOLE else value
