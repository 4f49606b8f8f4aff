"""The fields of a scene file, their types, units, defaults and ranges; `scenes/README.md` is their manual."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
GreyLevel = Annotated[float, Field(ge=0, le=255, allow_inf_nan=False)]
Point2 = tuple[Number, Number]
Point3 = tuple[Number, Number, Number]
GridRow = Annotated[str, Field(min_length=1, max_length=200)]
Copies = Annotated[int, Field(ge=1, le=100)]
Kind = Annotated[str, Field(min_length=1, max_length=200)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 _.-]{0,63}$")]


class StrictTable(BaseModel):
    """A table of a TOML file: unknown fields are errors, values are never converted silently."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class CameraTable(StrictTable):
    """`[camera]`: in pixels, in millimetres of lens and sensor, or a camera by name."""

    name: str | None = None
    width: Annotated[int, Field(ge=1, le=20_000)] | None = None
    height: Annotated[int, Field(ge=1, le=20_000)] | None = None
    fx: Positive | None = None
    fy: Positive | None = None
    focal_mm: Positive | None = None
    sensor_width_mm: Positive | None = None
    cx: Number | None = None
    cy: Number | None = None
    distortion: tuple[Number, ...] = ()
    model: Literal["brown", "fisheye"] = "brown"
    row_time_s: NotNegative = 0.0
    exposure_s: NotNegative = 0.0
    focus_m: Positive | None = None
    aperture_m: Positive | None = None
    f_number: Positive | None = None

    @model_validator(mode="after")
    def _one_aperture(self) -> "CameraTable":
        apertures = (self.aperture_m is not None) + (self.f_number is not None)
        if apertures != (self.focus_m is not None):
            raise ValueError("expected focus_m together with one of aperture_m and f_number")
        if self.f_number is not None and self.focal_mm is None:
            raise ValueError("expected focal_mm beside f_number, whose aperture is a share of it; or aperture_m")
        return self

    @model_validator(mode="after")
    def _one_description(self) -> "CameraTable":
        given = {
            name
            for name in ("width", "height", "fx", "fy", "focal_mm", "sensor_width_mm")
            if getattr(self, name) is not None
        }
        if self.name is not None:
            if given - {"focal_mm"}:
                raise ValueError(f"expected only focal_mm beside name, got {', '.join(sorted(given - {'focal_mm'}))}")
        elif given - {"fy"} not in ({"width", "height", "fx"}, {"width", "height", "focal_mm", "sensor_width_mm"}):
            raise ValueError("expected width and height with either fx, or focal_mm and sensor_width_mm; or name")
        return self


class WaypointTable(StrictTable):
    """`[[trajectory]]`: where the camera is at a time, and what it looks at."""

    time_s: NotNegative = 0.0
    eye_m: Point3
    target_m: Point3


class MaterialTable(StrictTable):
    """`[materials.NAME]`: how printed levels reflect light, and whether the surface shines."""

    kind: Literal["diffuse", "plastic"] = "diffuse"
    reflectance: tuple[Number, Number] = (0.0, 1.0)
    curve: Literal["linear", "srgb"] = "linear"
    roughness: NotNegative = 0.1
    ior: Positive = 1.5


class TextureTable(StrictTable):
    """`[textures.NAME]`: a photograph with its physical size, or a plain level."""

    file: str | None = None
    variants: dict[Name, str] = Field(default_factory=dict)
    photo_m: Positive = 1.0
    contrast: NotNegative = 1.0
    mean: GreyLevel | None = None
    level: GreyLevel | None = None
    material: Name | None = None

    @model_validator(mode="after")
    def _one_source(self) -> "TextureTable":
        if sum([self.file is not None, bool(self.variants), self.level is not None]) != 1:
            raise ValueError("expected exactly one of file, variants and level")
        return self


class RoomTable(StrictTable):
    """`[room]`: an axis-aligned box; the named faces are papered with textures."""

    min_m: Point3
    max_m: Point3
    floor: str | None = None
    walls: str | tuple[str, str, str, str] | None = None
    ceiling: str | None = None

    @model_validator(mode="after")
    def _not_empty(self) -> "RoomTable":
        if not all(a < b for a, b in zip(self.min_m, self.max_m, strict=True)):
            raise ValueError(f"expected min_m below max_m on every axis, got {self.min_m} and {self.max_m}")
        return self


class BentTable(StrictTable):
    """What paper of every kind may state: how it is bent."""

    bend_radius_m: Number | None = None
    bend_axis: Literal["x", "y"] = "y"


class QuadTable(BentTable):
    """`[[quads]]`: a rectangle with a texture on its printed face."""

    name: Name
    texture: str
    size_m: tuple[Positive, Positive]
    center_m: Point3
    normal: Point3
    up: Point3


class MarkerTable(BentTable):
    """`[[markers]]`: one printed marker on white paper."""

    name: Name
    kind: Kind
    side_m: Positive
    border_m: NotNegative = 0.0
    center_m: Point3
    normal: Point3 = (0.0, 0.0, 1.0)
    up: Point3 = (0.0, 1.0, 0.0)
    material: Name | None = None


class MarkerPathTable(StrictTable):
    """`[[marker_paths]]`: markers at equal steps along a smooth curve on the floor."""

    name: Name
    kind: Kind
    count: Annotated[int, Field(ge=1, le=10_000)]
    side_m: Positive
    border_m: NotNegative = 0.0
    waypoints_m: Annotated[tuple[Point2, ...], Field(min_length=2)]
    height_m: NotNegative = 0.001
    material: Name | None = None


class PosterTable(BentTable):
    """`[[posters]]`: paper with a grid of markers of one size, hung once or several times side by side."""

    name: Name
    paper_m: tuple[Positive, Positive] = (0.210, 0.297)
    level: GreyLevel = 255.0
    rows: Annotated[tuple[GridRow, ...], Field(min_length=1, max_length=200)]
    kinds: dict[Annotated[str, Field(min_length=1, max_length=1)], Kind] = Field(
        default_factory=lambda: {"D": "surf-dark", "L": "surf-light"}
    )
    side_m: Positive
    pitch_m: Positive
    center_m: Point3
    normal: Point3
    up: Point3 = (0.0, 0.0, 1.0)
    turn_deg: Number = 0.0
    copies: tuple[Copies, Copies] = (1, 1)
    step_m: tuple[Positive, Positive] | None = None
    material: Name | None = None

    @model_validator(mode="after")
    def _fits(self) -> "PosterTable":
        known = {".", *self.kinds}
        if {letter for row in self.rows for letter in row} - known or len({len(row) for row in self.rows}) > 1:
            letters = " ".join(sorted(known))
            raise ValueError(f"expected rows of equal length with the letters {letters}, got {self.rows!r}")
        if not self.side_m <= self.pitch_m:
            raise ValueError(f"expected pitch_m of at least side_m, got {self.pitch_m} and {self.side_m}")
        used = [(n - 1) * self.pitch_m + self.side_m for n in (len(self.rows[0]), len(self.rows))]
        if not all(a <= b + 1e-9 for a, b in zip(used, self.paper_m, strict=True)):
            raise ValueError(f"expected paper_m of at least {used[0]:.4g}×{used[1]:.4g} m, got {self.paper_m}")
        return self


class SheetTable(BentTable):
    """`[[sheets]]`: a page that `peakmark marker` printed, from its result.json."""

    name: Name
    file: str
    page: Annotated[int, Field(ge=1, le=10_000)] = 1
    center_m: Point3
    normal: Point3
    up: Point3 = (0.0, 0.0, 1.0)
    turn_deg: Number = 0.0
    material: Name | None = None


class MeshTable(StrictTable):
    """`[[meshes]]`: a solid from a file, with its images and colours."""

    name: Name
    file: str
    scale: Positive = 1.0
    center_m: Point3 = (0.0, 0.0, 0.0)
    rotation_deg: Point3 = (0.0, 0.0, 0.0)
    up: Literal["y", "z"] | None = None
    level: GreyLevel = 128.0
    material: Name | None = None


class BoxTable(StrictTable):
    """`[[boxes]]`: a solid box that stands on `center_m`."""

    name: Name
    size_m: tuple[Positive, Positive, Positive]
    center_m: Point3
    yaw_deg: Number = 0.0
    level: GreyLevel = 128.0
    material: Name | None = None


class DeskTable(StrictTable):
    """`[[tables]]`: a table top on four legs, standing on `center_m`."""

    name: Name
    size_m: tuple[Positive, Positive, Positive]
    center_m: Point3
    yaw_deg: Number = 0.0
    level: GreyLevel = 128.0
    top_m: Positive = 0.03
    leg_m: Positive = 0.05
    material: Name | None = None

    @model_validator(mode="after")
    def _has_legs(self) -> "DeskTable":
        width, depth, height = self.size_m
        if not (self.top_m < height and 2 * self.leg_m <= min(width, depth)):
            raise ValueError("expected top_m below the height and legs that fit under the top")
        return self


class LightTable(StrictTable):
    """`[[lights]]`: a multiplier of linear grey levels."""

    kind: Literal["ambient", "directional", "point"]
    intensity: NotNegative
    direction: Point3 = (0.0, 0.0, -1.0)
    position_m: Point3 = (0.0, 0.0, 2.5)
    reference_m: Positive = 1.0
    casts_shadows: bool = True


class AreaLightTable(StrictTable):
    """`[[lights]]` of kind "area", a shining rectangle, or "window", one of the sky's brightness in a wall."""

    kind: Literal["area", "window"]
    center_m: Point3
    size_m: tuple[Positive, Positive]
    radiance: NotNegative | None = None
    normal: Point3 = (0.0, 0.0, -1.0)
    up: Point3 = (0.0, 0.0, 1.0)

    @model_validator(mode="after")
    def _is_stated(self) -> "AreaLightTable":
        needed = "radiance" if self.kind == "area" else "normal"
        if needed not in self.model_fields_set:
            raise ValueError(f'expected {needed} for a light of kind "{self.kind}"')
        return self


class EnvironmentTable(StrictTable):
    """`[[lights]]` of kind "environment": an even sky, or an image of the surroundings."""

    kind: Literal["environment"]
    radiance: NotNegative = 1.0
    file: str | None = None
    curve: Literal["linear", "srgb"] = "srgb"
    yaw_deg: Number = 0.0


AnyLightTable = Annotated[LightTable | AreaLightTable | EnvironmentTable, Field(discriminator="kind")]


class SceneTable(StrictTable):
    """The whole file."""

    background: GreyLevel = 128.0
    camera: CameraTable
    sensor: dict[str, Any] = Field(default_factory=dict)
    trajectory: Annotated[tuple[WaypointTable, ...], Field(min_length=1)]
    textures: dict[Name, TextureTable] = Field(default_factory=dict)
    room: RoomTable | None = None
    quads: tuple[QuadTable, ...] = ()
    markers: tuple[MarkerTable, ...] = ()
    marker_paths: tuple[MarkerPathTable, ...] = ()
    posters: tuple[PosterTable, ...] = ()
    sheets: tuple[SheetTable, ...] = ()
    boxes: tuple[BoxTable, ...] = ()
    tables: tuple[DeskTable, ...] = ()
    meshes: tuple[MeshTable, ...] = ()
    lights: tuple[AnyLightTable, ...] = ()
    materials: dict[Name, MaterialTable] = Field(default_factory=dict)
