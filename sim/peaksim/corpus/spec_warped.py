"""`[warped]` of a corpus file: printed sheets in photographs."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from peaksim.corpus.spread import Angle, Count, Length, Share, spread_field
from peaksim.scene.schema import Name, StrictTable


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
