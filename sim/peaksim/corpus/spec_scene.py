"""What of a scene changes from sequence to sequence: markers, what lies about, prints and textures, light."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from peaksim.corpus.spread import Angle, AnySpread, Count, Factor, Length, Level, Share, spread_field
from peaksim.scene.schema import Name, StrictTable


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
