"""What a corpus consists of: the fields of its TOML file, their types, defaults and ranges; CORPUS.md is the manual.

Numbers that vary are spreads (`peaksim.corpus.spread`).
"""

from collections import Counter
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from peaksim.camera.presets import sensor_named
from peaksim.camera.sensor import WHOLE, Sensor
from peaksim.corpus.spread import Angle, AnySpread, Count, Factor, Length, Level, Share, Spread
from peaksim.errors import InputError, SceneError
from peaksim.scene.schema import Name, NotNegative, Positive, StrictTable
from peaksim.shipped import path_inside
from peaksim.toml_file import parse_toml, validate
from peaksim.traced import MOST_SAMPLES

MOST_FRAMES = 10**8
"""Frame names have eight digits."""

Size = Annotated[int, Field(ge=1, le=20_000)]
Weight = NotNegative


def spread_field(value: Any) -> Any:
    """Return a field whose default is a spread."""
    return Field(default_factory=lambda: Spread.model_validate(value))


class PictureTable(StrictTable):
    """`[pictures]`: how images are encoded."""

    format: Literal["png", "jpeg"] = "png"
    quality: Annotated[int, Field(ge=1, le=100)] = 95


class StoreTable(StrictTable):
    """`[store]`: which files hold images and records."""

    files: bool = True
    shards: bool = True
    shard_frames: Annotated[int, Field(ge=1, le=10_000)] = 100
    part_frames: Annotated[int, Field(ge=1, le=1_000_000)] = 10_000

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if not (self.files or self.shards):
            raise ValueError("expected files or shards or both to be true, got neither")
        if self.part_frames % self.shard_frames:
            raise ValueError(
                f"expected part_frames to be a multiple of shard_frames, got {self.part_frames} and {self.shard_frames}"
            )
        return self


class SceneChoice(StrictTable):
    """`[[scenes]]`: one scene file of several."""

    file: str
    weight: Weight = 1.0


class CameraChoice(StrictTable):
    """`[[cameras]]`: one camera, or `count` of them drawn from the spreads."""

    name: Name
    weight: Weight = 1.0
    count: Annotated[int, Field(ge=1, le=1000)] = 1
    width: Size
    height: Size
    fx: Spread
    fy: Spread | None = None
    cx: Spread | None = None
    cy: Spread | None = None
    distortion: tuple[Spread, ...] = ()
    model: Literal["brown", "fisheye"] = "brown"

    @property
    def names(self) -> list[str]:
        """Names of the cameras that are drawn."""
        return [self.name] if self.count == 1 else [f"{self.name}-{i:03d}" for i in range(self.count)]


class RandomView(StrictTable):
    """`[[views]]` of kind "random": the camera anywhere in a box, looking at any point of another."""

    kind: Literal["random"]
    weight: Weight = 1.0
    eye_m: tuple[AnySpread, AnySpread, AnySpread]
    target_m: tuple[AnySpread, AnySpread, AnySpread]
    roll_deg: Angle = spread_field(0)
    min_markers: Annotated[int, Field(ge=0, le=1000)] = 0


class MarkerView(StrictTable):
    """`[[views]]` of kind "marker": around a marker that is drawn for each frame."""

    kind: Literal["marker"]
    weight: Weight = 1.0
    distance_m: Length
    tilt_deg: Angle = spread_field((0, 60))
    azimuth_deg: Angle = spread_field((0, 360))
    roll_deg: Angle = spread_field((-180, 180))
    off_axis: Share = spread_field((0, 0.5))
    min_markers: Annotated[int, Field(ge=0, le=1000)] = 1

    @model_validator(mode="after")
    def _sees_the_front(self) -> Self:
        low, high = self.tilt_deg.limits
        if not 0 <= low <= high < 90:
            raise ValueError(f"tilt_deg: expected 0…90 without 90, got {low:g}…{high:g}")
        return self


class FlightView(StrictTable):
    """`[[views]]` of kind "flight": along the scene's trajectory or a file's, in even steps of time."""

    kind: Literal["flight"]
    weight: Weight = 1.0
    file: str | None = None
    shift_m: AnySpread = spread_field(0)
    shake_deg: Angle = spread_field(0)
    min_markers: Literal[0] = 0


AnyView = Annotated[RandomView | MarkerView | FlightView, Field(discriminator="kind")]


class MarkerSpread(StrictTable):
    """`[markers]`: how the scene's markers change from sequence to sequence."""

    kinds: tuple[Name, ...] = ()
    keep: Share = spread_field(1)
    side_factor: Factor = spread_field(1)
    shift_m: AnySpread = spread_field(0)
    turn_deg: Angle = spread_field(0)

    @model_validator(mode="after")
    def _has_size(self) -> Self:
        if not self.side_factor.limits[0] > 0:
            raise ValueError(f"side_factor: expected positive numbers, got {self.side_factor.limits[0]:g}")
        return self


class ClutterSpread(StrictTable):
    """`[clutter]`: objects that are not markers, on the room's floor."""

    papers: Count = spread_field(0)
    paper_m: Length = spread_field((0.05, 0.3))
    boxes: Count = spread_field(0)
    box_m: Length = spread_field((0.1, 0.5))
    level: Level = spread_field((60, 200))


class OccluderSpread(StrictTable):
    """`[occluders]`: sheets of paper that lie on some of the markers and cover a part of each."""

    share: Share = spread_field(0)
    cover: Share = spread_field((0.05, 0.5))
    level: Level = spread_field((30, 230))


class BendSpread(StrictTable):
    """`[bends]`: markers on curled paper, whose edges or whose middle touch what they lie on."""

    share: Share = spread_field(0)
    radius_sides: Length = spread_field({"log_uniform": (0.6, 4)})
    inward: Share = spread_field(0.3)

    @model_validator(mode="after")
    def _is_no_tube(self) -> Self:
        if not self.radius_sides.limits[0] >= 0.4:
            raise ValueError(f"radius_sides: expected at least 0.4, got {self.radius_sides.limits[0]:g}")
        return self


class PrintSpread(StrictTable):
    """`[prints]`: ink and paper of markers, posters and clutter, one for a sequence."""

    black: Share = spread_field((0.03, 0.08))
    white: Share = spread_field((0.75, 0.9))
    curve: Annotated[tuple[Literal["linear", "srgb"], ...], Field(min_length=1)] = ("linear", "srgb")
    gloss: Share = spread_field(0)
    roughness: Share = spread_field((0.08, 0.3))

    @model_validator(mode="after")
    def _is_dark_on_light(self) -> Self:
        if not self.black.limits[1] < self.white.limits[0]:
            darkest, lightest = self.white.limits[0], self.black.limits[1]
            raise ValueError(f"expected black below white, got up to {lightest:g} and from {darkest:g} on")
        return self


class TextureSpread(StrictTable):
    """`[textures.NAME]`: how a scene's texture changes from sequence to sequence; unset fields stay the scene's."""

    variants: tuple[Name, ...] = ()
    contrast: Factor | None = None
    mean: Level | None = None


class LightSpread(StrictTable):
    """`[light]`: replaces the scene's lights; the multipliers of `peaksim.Light`, and lamps of `peaksim.AreaLight`."""

    per: Literal["frame", "sequence"] = "frame"
    ambient: Factor
    directional: Factor = spread_field(0)
    elevation_deg: Angle = spread_field((30, 90))
    azimuth_deg: Angle = spread_field((0, 360))
    shadows: bool = True
    lamps: Count | None = None
    windows: Count | None = None
    lamp_m: Length | None = None
    lamp_radiance: Level | None = None

    @model_serializer(mode="wrap")
    def _values(self, to_values: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Return the values without lamps that nobody stated, so that the hashes of older suites stay."""
        later = ("lamps", "windows", "lamp_m", "lamp_radiance")
        return {name: value for name, value in to_values(self).items() if name not in later or value is not None}

    @property
    def has_lamps(self) -> bool:
        """Whether lamps or windows can come."""
        return any(count is not None and count.limits[1] > 0 for count in (self.lamps, self.windows))

    @model_validator(mode="after")
    def _from_above(self) -> Self:
        low, high = self.elevation_deg.limits
        if not 0 < low <= high <= 90:
            raise ValueError(f"elevation_deg: expected above 0 up to 90, got {low:g}…{high:g}")
        return self


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


class WarpedSpread(StrictTable):
    """`[warped]`: printed sheets in photographs, in place of scenes and views."""

    photographs: str | None = None
    sheets: Count = spread_field({"integers": (3, 8)})
    kinds: Annotated[tuple[Name, ...], Field(min_length=1)] = ("surf-dark", "surf-light")
    side_px: Length = spread_field({"log_uniform": (15, 120)})
    side_m: Length = spread_field((0.05, 0.2))
    border: Share = spread_field((0.1, 0.3))
    tilt_deg: Angle = spread_field((0, 70))
    azimuth_deg: Angle = spread_field((0, 360))
    roll_deg: Angle = spread_field((-180, 180))

    @property
    def kind(self) -> str:
        """What records call the view."""
        return "warped"

    @model_validator(mode="after")
    def _sees_the_front(self) -> Self:
        low, high = self.tilt_deg.limits
        if not 0 <= low <= high < 90:
            raise ValueError(f"tilt_deg: expected 0…90 without 90, got {low:g}…{high:g}")
        return self


def sensor_value(name: str, value: float) -> int | float:
    """Return a sensor field's value in the type that `Sensor` takes."""
    return int(value) if name in WHOLE else value


class CorpusSpec(StrictTable):
    """The whole file."""

    name: Name
    frames: Annotated[int, Field(ge=1, le=MOST_FRAMES)]
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    sequence_frames: Annotated[int, Field(ge=1, le=MOST_FRAMES)] = 50
    frames_per_second: Positive = 10.0
    renderer: Literal["auto", "gl", "exact", "pyrender", "traced"] = "auto"
    samples: Annotated[int, Field(ge=1, le=MOST_SAMPLES)] | None = None
    bake: bool | None = None
    pictures: PictureTable = PictureTable()
    store: StoreTable = StoreTable()
    scenes: tuple[SceneChoice, ...] = ()
    cameras: tuple[CameraChoice, ...] = ()
    views: tuple[AnyView, ...] = ()
    warped: WarpedSpread | None = None
    markers: MarkerSpread = MarkerSpread()
    clutter: ClutterSpread = ClutterSpread()
    occluders: OccluderSpread | None = None
    bends: BendSpread | None = None
    prints: PrintSpread | None = None
    textures: dict[Name, TextureSpread] = Field(default_factory=dict)
    light: LightSpread | None = None
    sensor: SensorSpread = SensorSpread()

    @model_validator(mode="after")
    def _has_a_source(self) -> Self:
        if self.warped is None:
            for field in ("scenes", "views"):
                if not getattr(self, field):
                    raise ValueError(f"{field}: expected at least one, or [warped], got none")
            return self
        if not self.cameras:
            raise ValueError("cameras: expected at least one beside [warped], got none")
        for field in ("scenes", "views", "markers", "clutter", "occluders", "textures", "light"):
            if getattr(self, field) != type(self).model_fields[field].get_default(call_default_factory=True):
                raise ValueError(f"{field}: expected none beside [warped], which has no scenes")
        return self

    @model_validator(mode="after")
    def _can_be_drawn(self) -> Self:
        for field in ("scenes", "cameras", "views"):
            choices = getattr(self, field)
            if choices and not sum(choice.weight for choice in choices) > 0:
                raise ValueError(f"{field}: expected at least one positive weight, got none")
        twice = [name for name, count in Counter(self.camera_names).items() if count > 1]
        if twice:
            raise ValueError(f"cameras: expected different names, got {twice[0]!r} more than once")
        return self

    @model_serializer(mode="wrap")
    def _values(self, to_values: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Return the values without later fields that nobody stated, so that the hashes of older suites stay."""
        later = ("samples", "bake", "occluders", "bends", "prints", "warped")
        return {name: value for name, value in to_values(self).items() if name not in later or value is not None}

    @property
    def camera_names(self) -> tuple[str, ...]:
        """Names of the cameras that are drawn; none if every scene keeps its own."""
        return tuple(name for choice in self.cameras for name in choice.names)

    def __hash__(self) -> int:
        return hash((self.name, self.frames, self.seed))

    @property
    def sequences(self) -> int:
        """How many sequences there are; the last may be shorter."""
        return -(-self.frames // self.sequence_frames)


def load_spec(
    path: str | Path, *, seed: int | None = None, frames: int | None = None, photographs: Path | None = None
) -> CorpusSpec:
    """Read a corpus file; `seed`, `frames` and the folder of `photographs` of its `[warped]` replace the file's.

    Raises
    ------
    SceneError
        One line that names the file, the field, what was expected and what came.
    """
    table = parse_toml(Path(path))
    overrides = {"seed": seed, "frames": frames}
    table.update({name: value for name, value in overrides.items() if value is not None})
    spec = validate(CorpusSpec, table, str(path))
    if photographs is not None:
        if spec.warped is None:
            raise SceneError(f"--photographs {photographs}: expected a specification with [warped], {path} has none")
        warped = spec.warped.model_copy(update={"photographs": str(photographs.resolve())})
        return spec.model_copy(update={"warped": warped})
    if spec.warped is not None and spec.warped.photographs is not None:
        path_inside(Path(path).parent, spec.warped.photographs, f"{path}: warped.photographs")
    return spec


def spec_from_json(text: str) -> CorpusSpec:
    """Read a specification back from `spec_to_json`.

    Raises
    ------
    InputError
        If it is not one.
    """
    try:
        return CorpusSpec.model_validate_json(text)
    except ValueError as error:
        raise InputError(f"corpus: expected the specification of a corpus, got {text[:60]!r}") from error


def spec_to_json(spec: CorpusSpec) -> str:
    """Return a specification as one line of JSON, defaults included."""
    return spec.model_dump_json(exclude_none=True)
