"""What a corpus consists of: the fields of its TOML file, their types, defaults and ranges; CORPUS.md is the manual.

Numbers that vary are spreads (`peaksim.corpus.spread`).
"""

from collections import Counter
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from peaksim.corpus.spec_scene import (
    BendSpread,
    ClutterSpread,
    LightSpread,
    MarkerSpread,
    OccluderSpread,
    PrintSpread,
    TextureSpread,
)
from peaksim.corpus.spec_sensor import SensorSpread
from peaksim.corpus.spec_views import AnyView
from peaksim.corpus.spec_warped import WarpedSpread
from peaksim.corpus.spread import Spread, Weight
from peaksim.errors import InputError, SceneError
from peaksim.scene.schema import Name, Positive, StrictTable
from peaksim.shipped import path_inside
from peaksim.toml_file import parse_toml, validate
from peaksim.traced import MOST_SAMPLES

MOST_FRAMES = 10**8
"""Frame names have eight digits."""

Size = Annotated[int, Field(ge=1, le=20_000)]


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
