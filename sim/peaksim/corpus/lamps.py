"""Lamps and windows of a frame or sequence, drawn from `[light]`."""

from collections.abc import Iterator

import numpy as np

from peaksim.corpus.draws import Draws
from peaksim.corpus.spec_scene import LightSpread
from peaksim.corpus.spread import Spread
from peaksim.scene.lamps import AreaLight
from peaksim.scene.schema import RoomTable

LAMP_M, LAMP_RADIANCE = Spread(uniform=(0.3, 1.2)), Spread(uniform=(8.0, 25.0))
"""Sides of lamps and windows, and their radiance, where `[light]` does not state them."""
_BELOW_M = 0.02
"""Lamps hang this far below the ceiling, and windows stand this far before their wall."""


def lamps_in(room: RoomTable, spread: LightSpread, draws: Draws) -> Iterator[AreaLight]:
    """Yield the lamps under the room's ceiling and the windows in its walls."""
    low, high = np.array(room.min_m), np.array(room.max_m)
    for name, count in (("lamp", spread.lamps), ("window", spread.windows)):
        for k in range(0 if count is None else int(draws.value(f"light.{name}s", count))):
            field = f"light.{name}{k}"
            size_m = [draws.value(f"{field}.{side}", spread.lamp_m or LAMP_M) for side in ("width", "height")]
            at = [draws.share(f"{field}.{axis}") for axis in "xyz"]
            axis, sign = (2, -1) if name == "lamp" else divmod(draws.index(f"{field}.wall", (1.0,) * 4), 2)
            sign = sign if name == "lamp" else 1 - 2 * sign
            normal = np.zeros(3)
            normal[axis] = sign
            # both sides fit into the room's face with its corners
            across = np.array([max(size_m)] * 2 + [size_m[1] if name == "window" else 0.0]) / 2
            free = np.maximum(high - low - 2 * across, 0)
            center = low + np.minimum(across, (high - low) / 2) + free * at
            center[axis] = (low[axis] if sign > 0 else high[axis]) + sign * _BELOW_M
            (x, y, z), (nx, ny, nz) = center.tolist(), normal.tolist()
            radiance = draws.value(f"{field}.radiance", spread.lamp_radiance or LAMP_RADIANCE)
            yield AreaLight((x, y, z), (size_m[0], size_m[1]), radiance, (nx, ny, nz))
