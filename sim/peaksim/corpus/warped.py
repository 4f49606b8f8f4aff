"""Sheets before a camera, as `[warped]` spreads them; a photograph is behind them."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from peaksim.camera.camera import Camera
from peaksim.corpus.draws import Draws
from peaksim.corpus.spec_scene import BendSpread, PrintSpread
from peaksim.corpus.spec_warped import WarpedSpread
from peaksim.corpus.vary import bent_marker, drawn_print
from peaksim.geometry.pose import Pose, look_at, transform
from peaksim.scene.build_markers import marker_quads
from peaksim.scene.material import Material
from peaksim.scene.scene import Scene
from peaksim.scene.schema import MarkerTable

_ATTEMPTS = 40
"""Positions that are tried for a sheet before the image is called full."""
_REACH = 0.75
"""Sheets keep at least so many of their widths from each other's middles and from the border: half a diagonal."""
PRINT = "print"

POSE: Pose = look_at((0.0, 0.0, 1.5), (0.0, 1.0, 1.5))
"""(4, 4) `world_from_camera` of all frames: upright, along y."""


def warped_scene(
    spread: WarpedSpread, bends: BendSpread | None, prints: PrintSpread | None, camera: Camera, draws: Draws
) -> Scene:
    """Return the sheets of a frame, which do not overlap in its image."""
    tables = tuple(bent_marker(sheet, bends, draws) for sheet in _sheets(spread, camera, draws))
    material = Material(**drawn_print(prints or PrintSpread(), draws).model_dump())
    return Scene(tuple(marker_quads(tables, (), None, {PRINT: material})))


def _sheets(spread: WarpedSpread, camera: Camera, draws: Draws) -> Iterator[MarkerTable]:
    taken: list[tuple[NDArray[np.float64], float]] = []
    for k in range(int(draws.value("warped.sheets", spread.sheets))):
        field = f"warped.sheet{k}"
        side_px = draws.value(f"{field}.side_px", spread.side_px)
        border = draws.value(f"{field}.border", spread.border)
        reach_px = _REACH * side_px * (1 + 2 * border)
        xy = _free_position(camera, reach_px, taken, draws, field)
        if xy is not None:
            taken.append((xy, reach_px))
            yield _sheet(spread, camera, draws, field, xy, side_px, border, len(taken))


def _free_position(
    camera: Camera, reach_px: float, taken: list[tuple[NDArray[np.float64], float]], draws: Draws, field: str
) -> NDArray[np.float64] | None:
    """Return (2,) px where a sheet has room; None if none was found, or the lens sees nothing there."""
    size = np.array([camera.width, camera.height])
    for attempt in range(_ATTEMPTS):
        share = np.array([draws.share(f"{field}.{axis}{attempt}") for axis in "xy"])
        xy = reach_px - 0.5 + share * np.maximum(size - 2 * reach_px, 0)
        if all(np.linalg.norm(xy - other) > reach_px + reach for other, reach in taken):
            return xy if np.isfinite(camera.unproject(xy)).all() else None
    return None


def _sheet(
    spread: WarpedSpread,
    camera: Camera,
    draws: Draws,
    field: str,
    xy: NDArray[np.float64],
    side_px: float,
    border: float,
    number: int,
) -> MarkerTable:
    """Return a marker on its sheet, as large and as tilted as drawn, around the ray of a pixel."""
    tilt, azimuth, roll = (
        np.radians(draws.value(f"{field}.{name}", angle))
        for name, angle in (("tilt", spread.tilt_deg), ("azimuth", spread.azimuth_deg), ("roll", spread.roll_deg))
    )
    side_m = draws.value(f"{field}.side_m", spread.side_m)
    ray = camera.unproject(xy)[0]
    ray /= np.linalg.norm(ray)
    # the image of a small sheet shrinks by √cos of its tilt
    distance_m = np.sqrt(camera.fx * camera.fy * np.cos(tilt)) * side_m / side_px
    right = np.cross([0.0, 1.0, 0.0], ray)
    basis = np.stack([right / np.linalg.norm(right), np.cross(ray, right) / np.linalg.norm(right), -ray], axis=1)
    around = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    normal = basis @ (np.sin(tilt) * around + [0.0, 0.0, np.cos(tilt)])
    across = np.cross(normal, basis @ [np.cos(roll), np.sin(roll), 0.0])
    kind = draws.pick(f"{field}.kind", spread.kinds)
    return MarkerTable(
        name=f"sheet{number:02d}",
        kind=kind,
        side_m=side_m,
        border_m=border * side_m,
        center_m=_triple(transform(POSE, distance_m * ray)),
        normal=_triple(POSE[:3, :3] @ normal),
        up=_triple(POSE[:3, :3] @ across),
        material=PRINT,
    )


def _triple(values: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
