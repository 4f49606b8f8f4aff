"""Domain randomisation: a scene file's tables → the tables of one sequence. Pure functions over frozen tables."""

import numpy as np
from numpy.typing import NDArray

from peaksim.corpus.draws import Draws
from peaksim.corpus.spec import CorpusSpec
from peaksim.corpus.spec_scene import (
    BendSpread,
    ClutterSpread,
    MarkerSpread,
    OccluderSpread,
    PrintSpread,
    TextureSpread,
)
from peaksim.errors import SceneError
from peaksim.geometry.pose import Pose, rotation_about
from peaksim.scene.build_markers import path_poses
from peaksim.scene.build_quads import quad_pose
from peaksim.scene.schema import BoxTable, MarkerTable, MaterialTable, QuadTable, RoomTable, SceneTable, TextureTable

_GAP_M = 0.001  # between surfaces that lie on each other
_PRINT = "corpus print"
"""Name of the material of `[prints]`."""


def vary_scene(table: SceneTable, spec: CorpusSpec, draws: Draws) -> SceneTable:
    """Return a scene's tables as one sequence of a corpus has them.

    Raises
    ------
    SceneError
        If the specification needs something that the scene does not have, such as clutter without a room.
    """
    textures = {
        name: _varied_texture(texture, spec.textures[name], draws, name) if name in spec.textures else texture
        for name, texture in table.textures.items()
    }
    changed = table.model_copy(
        update={
            "textures": textures,
            "markers": tuple(
                bent_marker(m, spec.bends, draws) for m in _varied_markers(all_markers(table), spec, draws)
            ),
            "marker_paths": (),
        }
    )
    with_clutter = _with_clutter(changed, spec.clutter, draws)
    if spec.occluders is not None:
        with_clutter = with_occluders(with_clutter, spec.occluders, draws)
    return with_clutter if spec.prints is None else _printed(with_clutter, spec.prints, draws)


def _varied_texture(texture: TextureTable, spread: TextureSpread, draws: Draws, name: str) -> TextureTable:
    update: dict[str, object] = {}
    if spread.variants:
        for variant in spread.variants:
            if variant not in texture.variants:
                raise SceneError(
                    f"textures.{name}.variants: expected some of {', '.join(texture.variants) or 'none'}, "
                    f"got {variant!r}"
                )
        chosen = spread.variants[draws.index(f"textures.{name}.variants", (1.0,) * len(spread.variants))]
        update["variants"] = {chosen: texture.variants[chosen]}
    for field in ("contrast", "mean"):
        if (values := getattr(spread, field)) is not None:
            update[field] = draws.value(f"textures.{name}.{field}", values)
    return texture.model_copy(update=update)


# --- markers ----------------------------------------------------------------------------------------------------


def all_markers(table: SceneTable) -> tuple[MarkerTable, ...]:
    """Return a scene's markers one by one, those on paths included, under the names they have in the scene."""
    on_paths = [
        MarkerTable(
            name=f"{path.name}{j + 1:02d}",
            kind=path.kind,
            side_m=path.side_m,
            border_m=path.border_m,
            center_m=_triple(pose[:3, 3]),
            normal=_triple(pose[:3, 2]),
            up=_triple(pose[:3, 1]),
        )
        for path in table.marker_paths
        for j, pose in enumerate(path_poses(path))
    ]
    return (*table.markers, *on_paths)


def poster_kinds(table: SceneTable) -> list[str]:
    """Return the kind of every marker on a scene's posters, which stay as the scene has them."""
    return [
        poster.kinds[letter]
        for poster in table.posters
        for row in poster.rows
        for letter in row
        if letter in poster.kinds
        for _ in range(poster.copies[0] * poster.copies[1])
    ]


def _triple(values: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _varied_markers(markers: tuple[MarkerTable, ...], spec: CorpusSpec, draws: Draws) -> list[MarkerTable]:
    """Return the markers that stay, as many as the views need at least, each varied."""
    keep = draws.value("markers.keep", spec.markers.keep)
    shares = [draws.share(f"markers.keep.{marker.name}") for marker in markers]
    count = max(sum(share < keep for share in shares), markers_needed(spec))
    chosen = sorted(np.argsort(shares, kind="stable")[:count])
    return [_varied_marker(markers[i], spec.markers, draws) for i in chosen]


def markers_needed(spec: CorpusSpec) -> int:
    """Return how many markers a scene must keep for every kind of view to be possible."""
    return max(max(view.min_markers, 1 if view.kind == "marker" else 0) for view in spec.views)


def _varied_marker(marker: MarkerTable, spread: MarkerSpread, draws: Draws) -> MarkerTable:
    """Return a marker moved and rotated in its plane, scaled, and of another kind."""

    def value(field: str, axis: str = "") -> float:
        return draws.value(f"markers.{field}.{marker.name}{axis}", getattr(spread, field))

    pose: Pose = quad_pose(marker.normal, marker.up, marker.center_m, f"markers.{marker.name}")
    shift = pose[:3, :2] @ np.array([value("shift_m", ".x"), value("shift_m", ".y")])
    up = pose[:3, :3] @ rotation_about("z", value("turn_deg"))[:, 1]
    factor = value("side_factor")
    kinds = spread.kinds or (marker.kind,)
    return marker.model_copy(
        update={
            "kind": kinds[draws.index(f"markers.kinds.{marker.name}", (1.0,) * len(kinds))],
            "side_m": marker.side_m * factor,
            "border_m": marker.border_m * factor,
            "center_m": _triple(np.array(marker.center_m) + shift),
            "up": _triple(up),
        }
    )


def bent_marker(marker: MarkerTable, spread: BendSpread | None, draws: Draws) -> MarkerTable:
    """Return a marker whose paper may be curled about an axis; it is lifted until its edges lie where it lay."""
    if spread is None:
        return marker
    field = f"bends.{marker.name}"
    if not draws.share(f"{field}.share") < draws.value("bends.share", spread.share):
        return marker
    width_m = marker.side_m + 2 * marker.border_m
    radius_m = width_m * draws.value(f"{field}.radius", spread.radius_sides)
    inward = draws.share(f"{field}.inward") < draws.value("bends.inward", spread.inward)
    lift_m = 0.0 if inward else radius_m * (1 - np.cos(width_m / 2 / radius_m))
    normal = np.array(marker.normal) / np.linalg.norm(marker.normal)
    return marker.model_copy(
        update={
            "bend_radius_m": -radius_m if inward else radius_m,
            "bend_axis": draws.pick(f"{field}.axis", ("x", "y")),
            "center_m": _triple(np.array(marker.center_m) + lift_m * normal),
        }
    )


# --- clutter ----------------------------------------------------------------------------------------------------


def _with_clutter(table: SceneTable, spread: ClutterSpread, draws: Draws) -> SceneTable:
    papers = int(draws.value("clutter.papers", spread.papers))
    boxes = int(draws.value("clutter.boxes", spread.boxes))
    if papers + boxes == 0:
        return table
    if table.room is None:
        raise SceneError("clutter: expected a scene with a room to put it in, this one has none")
    levels = {
        f"clutter paper {i}": TextureTable(level=draws.value(f"clutter.level.paper{i}", spread.level))
        for i in range(papers)
    }
    photographs = tuple(sorted(table.textures))
    return table.model_copy(
        update={
            "textures": {**table.textures, **levels},
            "quads": (*table.quads, *(_paper(i, photographs, table.room, spread, draws) for i in range(papers))),
            "boxes": (*table.boxes, *(_box(i, table.room, spread, draws) for i in range(boxes))),
        }
    )


def _paper(i: int, photographs: tuple[str, ...], room: RoomTable, spread: ClutterSpread, draws: Draws) -> QuadTable:
    """Return a sheet on the floor, plain or with a photograph; each lies a little above the last one."""
    name = f"clutter paper {i}"
    choices = (name, *photographs)
    angle = np.radians(360 * draws.share(f"{name}.turn"))
    x, y = _floor_point(room, draws, name)
    return QuadTable(
        name=name,
        texture=choices[draws.index(f"{name}.texture", (1.0,) * len(choices))],
        size_m=(draws.value(f"{name}.width", spread.paper_m), draws.value(f"{name}.height", spread.paper_m)),
        center_m=(x, y, room.min_m[2] + (i + 2) * _GAP_M),
        normal=(0.0, 0.0, 1.0),
        up=(float(-np.sin(angle)), float(np.cos(angle)), 0.0),
    )


def _box(i: int, room: RoomTable, spread: ClutterSpread, draws: Draws) -> BoxTable:
    name = f"clutter box {i}"
    width, depth, height = (draws.value(f"{name}.{axis}", spread.box_m) for axis in "xyz")
    x, y = _floor_point(room, draws, name)
    return BoxTable(
        name=name,
        size_m=(width, depth, height),
        center_m=(x, y, room.min_m[2]),
        yaw_deg=360 * draws.share(f"{name}.yaw"),
        level=draws.value(f"{name}.level", spread.level),
    )


def _floor_point(room: RoomTable, draws: Draws, name: str) -> tuple[float, float]:
    """Return a point of the room's floor."""
    x, y = (
        low + draws.share(f"{name}.{axis}") * (high - low)
        for axis, low, high in zip("xy", room.min_m[:2], room.max_m[:2], strict=True)
    )
    return x, y


# --- occluders and prints -----------------------------------------------------------------------------------------


def with_occluders(table: SceneTable, spread: OccluderSpread, draws: Draws) -> SceneTable:
    """Return the scene with a sheet of paper over a part of some of its flat markers."""
    share = draws.value("occluders.share", spread.share)
    flat = [marker for marker in table.markers if marker.bend_radius_m is None]
    covered = [marker for marker in flat if draws.share(f"occluders.share.{marker.name}") < share]
    names = {marker.name: f"occluder {k}" for k, marker in enumerate(covered)}
    levels = {
        name: TextureTable(level=draws.value(f"occluders.level.{marker}", spread.level))
        for marker, name in names.items()
    }
    sheets = tuple(_occluder(marker, names[marker.name], spread, draws) for marker in covered)
    return table.model_copy(update={"textures": {**table.textures, **levels}, "quads": (*table.quads, *sheets)})


def _occluder(marker: MarkerTable, name: str, spread: OccluderSpread, draws: Draws) -> QuadTable:
    """Return a sheet whose straight edge leaves a drawn share of the marker's pattern uncovered, from any side."""
    pose = quad_pose(marker.normal, marker.up, marker.center_m, f"markers.{marker.name}")
    angle = 2 * np.pi * draws.share(f"occluders.angle.{marker.name}")
    edge_m = marker.side_m * edge_offset(draws.value(f"occluders.cover.{marker.name}", spread.cover), angle)
    size_m = 2 * marker.side_m
    towards = pose[:3, :2] @ [np.cos(angle), np.sin(angle)]
    center = pose[:3, 3] + (edge_m + size_m / 2) * towards + _GAP_M / 2 * pose[:3, 2]
    return QuadTable(
        name=name,
        texture=name,
        size_m=(size_m, size_m),
        center_m=_triple(center),
        normal=_triple(pose[:3, 2]),
        up=_triple(towards),
    )


def edge_offset(cover: float, angle: float) -> float:
    """Return how far from a unit square's middle a straight edge lies, beyond which is a share `cover` of its area.

    The edge is across a direction of `angle` (radians); the area beyond it is that of a sum of two uniform numbers.
    """
    if cover > 0.5:
        return -edge_offset(1 - cover, angle)
    short, long = sorted((abs(np.cos(angle)), abs(np.sin(angle))))
    if cover * 2 * long <= short:
        return float((long + short) / 2 - np.sqrt(2 * long * short * cover))
    return float(long * (0.5 - cover))


def _printed(table: SceneTable, spread: PrintSpread, draws: Draws) -> SceneTable:
    """Return the scene with its markers, posters and clutter printed on one drawn material."""
    material = drawn_print(spread, draws)
    printed: dict[str, object] = {
        kind: tuple(one.model_copy(update={"material": _PRINT}) for one in getattr(table, kind))
        for kind in ("markers", "posters")
    }
    textures = {
        name: texture.model_copy(update={"material": _PRINT}) if name.startswith(("clutter", "occluder")) else texture
        for name, texture in table.textures.items()
    }
    return table.model_copy(
        update={**printed, "textures": textures, "materials": {**table.materials, _PRINT: material}}
    )


def drawn_print(spread: PrintSpread, draws: Draws) -> MaterialTable:
    """Return ink and paper from their spreads."""
    glossy = draws.share("prints.gloss.draw") < draws.value("prints.gloss", spread.gloss)
    return MaterialTable(
        kind="plastic" if glossy else "diffuse",
        reflectance=(draws.value("prints.black", spread.black), draws.value("prints.white", spread.white)),
        curve=spread.curve[draws.index("prints.curve", (1.0,) * len(spread.curve))],
        roughness=draws.value("prints.roughness", spread.roughness),
    )
