"""The views of a corpus file, `[[views]]`: how the camera's pose in a frame is drawn; CORPUS.md is the manual."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from peaksim.corpus.spread import Angle, AnySpread, Length, Share, Weight, spread_field
from peaksim.scene.schema import StrictTable


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
