"""The tables of a scene file → quads, meshes, lights, camera; each error starts with the field."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peaksim import shipped
from peaksim.camera.camera import Camera, from_sensor
from peaksim.camera.models import camera_named
from peaksim.camera.thin_lens import ThinLens, from_f_number
from peaksim.errors import InputError, SceneError
from peaksim.extras import needs_extra
from peaksim.geometry.floor_path import FloorPath
from peaksim.geometry.pose import Pose, compose, look_at, rotation_about
from peaksim.geometry.trajectory import Trajectory
from peaksim.image_file import read_image, read_image_8_bits
from peaksim.scene import schema as schema
from peaksim.scene.bend import Bend
from peaksim.scene.lamps import WINDOW_RADIANCE, AreaLight, Environment
from peaksim.scene.material import PRINT, Material, linear_from_srgb
from peaksim.scene.scene import Light, Mark, Mesh, Quad
from peaksim.scene.texture import Texture

_LARGEST_TEXTURE = 200_000_000  # texels of one papered surface, refused before they are made
_WHITE = 255

Materials = Mapping[str, Material]
PLAIN: Materials = MappingProxyType({})
"""No materials."""


def material_of(table: Any, materials: Materials, field: str) -> Material:
    """Return the material that a table names, `PRINT` if it names none."""
    if table.material is None:
        return PRINT
    if table.material not in materials:
        known = ", ".join(materials) or "the materials of the file"
        raise SceneError(f"{field}.material: expected one of {known}, got {table.material!r}")
    return materials[table.material]


def load_materials(tables: Mapping[str, schema.MaterialTable]) -> dict[str, Material]:
    """Return the materials of `[materials]`."""
    made = {}
    for name, table in tables.items():
        try:
            made[name] = Material(**table.model_dump())
        except SceneError as error:
            raise SceneError(f"materials.{name}: {error}") from error
    return made


# --- textures -----------------------------------------------------------------------------------------------


class Paper:
    """A wallpaper: a photograph of known physical size, repeated by mirroring to cover any surface."""

    def __init__(self, photo: NDArray[np.uint8], photo_m: float, material: Material = PRINT) -> None:
        self.photo = photo
        self.material = material
        self.texels_per_m = photo.shape[1] / photo_m

    def cover_surface(self, size_m: tuple[float, float], name: str) -> Texture:
        """Return the texture of a surface of this width and height."""
        width, height = (max(1, round(side * self.texels_per_m)) for side in size_m)
        if width * height > _LARGEST_TEXTURE:
            raise SceneError(f"{name}: expected at most {_LARGEST_TEXTURE} texels, got {width}×{height}; raise photo_m")
        rows, columns = _mirrored(height, self.photo.shape[0]), _mirrored(width, self.photo.shape[1])
        return Texture.from_array(np.take(np.take(self.photo, columns, axis=1), rows, axis=0))


def _mirrored(length: int, period: int) -> NDArray[np.int64]:
    """Return `length` indices that run 0…period−1, back to 0, and so on."""
    phase = np.arange(length) % (2 * period)
    return np.minimum(phase, 2 * period - 1 - phase)


def load_textures(
    tables: Mapping[str, schema.TextureTable], variants: Mapping[str, str], folder: Path, materials: Materials = PLAIN
) -> dict[str, Paper]:
    """Read every texture table; `variants` picks among a texture's variants (default: the first)."""
    for name in variants:
        if name not in tables or not tables[name].variants:
            raise SceneError(f"textures.{name}: expected a texture with variants, the file has none")
    return {
        name: _load_texture(name, table, variants.get(name), folder, material_of(table, materials, f"textures.{name}"))
        for name, table in tables.items()
    }


def _load_texture(
    name: str, table: schema.TextureTable, variant: str | None, folder: Path, material: Material
) -> Paper:
    if table.level is not None:
        return Paper(np.full((1, 1), round(table.level), np.uint8), table.photo_m, material)
    field, file = f"textures.{name}.file", table.file
    if table.variants:
        variant = variant or next(iter(table.variants))
        if variant not in table.variants:
            raise SceneError(f"textures.{name}: expected one of {', '.join(table.variants)}, got {variant!r}")
        field, file = f"textures.{name}.variants.{variant}", table.variants[variant]
    photo = _read_photo(shipped.file_beside(folder, str(file), field), field)
    return Paper(scale_contrast(photo, table.contrast, table.mean), table.photo_m, material)


def _read_photo(path: Path, field: str) -> NDArray[np.uint8]:
    try:
        return read_image_8_bits(path)
    except InputError as error:
        raise SceneError(f"{field}: {error}") from error


def scale_contrast(photo: NDArray[np.uint8], contrast: float, mean: float | None) -> NDArray[np.uint8]:
    """Scale the deviations from the mean grey level by `contrast` and move the mean to `mean`."""
    own_mean = photo.mean(axis=(0, 1))
    levels = contrast * (photo - own_mean) + (own_mean if mean is None else mean)
    return np.asarray(np.clip(np.rint(levels), 0, 255), dtype=np.uint8)


# --- flat surfaces ----------------------------------------------------------------------------------------------


def quad_pose(normal: ArrayLike, up: ArrayLike, center_m: ArrayLike, field: str) -> Pose:
    """Return `world_from_quad` of a quad whose printed face points along `normal` and whose top is towards `up`."""
    z = np.asarray(normal, dtype=np.float64)
    x = np.cross(np.asarray(up, dtype=np.float64), z)
    if not (np.linalg.norm(z) > 1e-9 and np.linalg.norm(x) > 1e-9):
        raise SceneError(f"{field}: expected normal and up that are not zero and not parallel, got {normal!r}, {up!r}")
    z, x = z / np.linalg.norm(z), x / np.linalg.norm(x)
    return compose(np.stack([x, np.cross(z, x), z], axis=1), center_m)


def build_quads(tables: tuple[schema.QuadTable, ...], textures: Mapping[str, Paper]) -> Iterator[Quad]:
    """Yield the quads of `[[quads]]`."""
    for i, table in enumerate(tables):
        paper = _texture(textures, table.texture, f"quads[{i}].texture")
        texture = paper.cover_surface(table.size_m, f"quads[{i}].size_m")
        pose = quad_pose(table.normal, table.up, table.center_m, f"quads[{i}]")
        bend = bend_of(table, table.size_m, f"quads[{i}]")
        yield Quad(table.name, texture, table.size_m, pose, material=paper.material, bend=bend)


def bend_of(table: schema.BentTable, size_m: tuple[float, float], field: str) -> Bend | None:
    """Return how paper of this width and height is bent; None for flat."""
    return None if table.bend_radius_m is None else Bend(table.bend_radius_m, table.bend_axis).checked(size_m, field)


def _texture(textures: Mapping[str, Paper], name: str, field: str) -> Paper:
    if name not in textures:
        raise SceneError(f"{field}: expected one of {', '.join(textures) or 'the textures of the file'}, got {name!r}")
    return textures[name]


def room_quads(room: schema.RoomTable | None, textures: Mapping[str, Paper]) -> Iterator[Quad]:
    """Yield the papered faces of the room, printed side inwards."""
    if room is None:
        return
    low, high = np.array(room.min_m), np.array(room.max_m)
    middle, (width, depth, height) = (low + high) / 2, high - low
    walls = room.walls if isinstance(room.walls, tuple) else (room.walls,) * 4
    faces: list[tuple[str, str | None, str, tuple[float, float], list[float], list[float], list[float]]] = [
        ("floor", room.floor, "floor", (width, depth), [middle[0], middle[1], low[2]], [0, 0, 1], [0, 1, 0]),
        ("ceiling", room.ceiling, "ceiling", (width, depth), [middle[0], middle[1], high[2]], [0, 0, -1], [0, 1, 0]),
        ("wall_x_min", walls[0], "walls", (depth, height), [low[0], middle[1], middle[2]], [1, 0, 0], [0, 0, 1]),
        ("wall_x_max", walls[1], "walls", (depth, height), [high[0], middle[1], middle[2]], [-1, 0, 0], [0, 0, 1]),
        ("wall_y_min", walls[2], "walls", (width, height), [middle[0], low[1], middle[2]], [0, 1, 0], [0, 0, 1]),
        ("wall_y_max", walls[3], "walls", (width, height), [middle[0], high[1], middle[2]], [0, -1, 0], [0, 0, 1]),
    ]
    for name, texture, field, size_m, center_m, normal, up in faces:
        if texture is not None:
            paper = _texture(textures, texture, f"room.{field}")
            size = (float(size_m[0]), float(size_m[1]))
            pose = quad_pose(normal, up, center_m, f"room.{field}")
            yield Quad(name, paper.cover_surface(size, f"room.{field}"), size, pose, material=paper.material)


# --- markers --------------------------------------------------------------------------------------------------


def marker_quads(
    markers: tuple[schema.MarkerTable, ...],
    paths: tuple[schema.MarkerPathTable, ...],
    room: schema.RoomTable | None,
    materials: Materials = PLAIN,
    folder: Path | None = None,
) -> Iterator[Quad]:
    """Yield every marker as a quad of white paper with the pattern in its middle; `folder` has those that are files."""
    for i, table in enumerate(markers):
        field = f"markers[{i}]"
        pose = quad_pose(table.normal, table.up, table.center_m, field)
        quad = _marker_quad(table.name, table, pose, field, material_of(table, materials, field), folder)
        quad = replace(quad, bend=bend_of(table, quad.size_m, field))
        yield check_inside(quad, room, f"{field}.center_m")
    for i, path in enumerate(paths):
        field = f"marker_paths[{i}]"
        material = material_of(path, materials, field)
        for j, pose in enumerate(path_poses(path)):
            quad = _marker_quad(f"{path.name}{j + 1:02d}", path, pose, field, material, folder)
            yield check_inside(quad, room, f"{field}.waypoints_m")


def _marker_quad(
    name: str,
    table: schema.MarkerTable | schema.MarkerPathTable,
    pose: Pose,
    field: str,
    material: Material,
    folder: Path | None,
) -> Quad:
    """Return the quad of one marker; its border is rounded to whole texels of the pattern."""
    pattern = marker_pattern(table.kind, f"{field}.kind", folder)
    texel_m = table.side_m / len(pattern)
    border = round(table.border_m / texel_m)
    side_m = (len(pattern) + 2 * border) * texel_m
    tile = _tile(pattern.tobytes(), pattern.shape, border)
    return Quad(name, tile, (side_m, side_m), pose, Mark(name, table.kind, table.side_m), material)


@lru_cache(maxsize=64)
def _tile(pattern: bytes, shape: tuple[int, ...], border: int) -> Texture:
    """Return a pattern with a white border of whole texels; equal markers share one texture."""
    edges = [(border, border), (border, border), (0, 0)][: len(shape)]
    return Texture.from_array(np.pad(np.frombuffer(pattern, np.uint8).reshape(shape), edges, constant_values=_WHITE))


def marker_pattern(kind: str, field: str, folder: Path | None = None) -> NDArray[np.uint8]:
    """Return the (side, side) image of a shipped marker, or of one's own: a square image in a folder, by its file."""
    known = _shipped_patterns()
    if kind in known:
        return _shipped_pattern(known[kind])
    if folder is None or "." not in kind:
        own = " or an image file" if folder is not None else ""
        raise SceneError(f"{field}: expected one of {', '.join(sorted(known))}{own}, got {kind!r}")
    pattern = _read_photo(shipped.file_inside(folder, kind, field), field)
    if pattern.shape[0] != pattern.shape[1]:
        raise SceneError(f"{field}: expected a square image, got {pattern.shape[1]}×{pattern.shape[0]} in {kind!r}")
    return pattern


@lru_cache(maxsize=1)
def _shipped_patterns() -> dict[str, Path]:
    return {path.stem: path for path in (shipped.ASSETS / "markers").glob("*.png")}


@lru_cache(maxsize=64)
def _shipped_pattern(path: Path) -> NDArray[np.uint8]:
    """Return a marker's image, read-only: a scene may have thousands of one kind."""
    pattern = _read_photo(path, path.name)
    pattern.setflags(write=False)
    return pattern


def path_poses(path: schema.MarkerPathTable) -> list[Pose]:
    """Return poses at equal arc lengths on a cubic spline through the waypoints, tops along the path."""
    curve = FloorPath(np.array(path.waypoints_m))
    arc = np.linspace(0, curve.length_m, path.count)
    return [
        compose(rotation_about("z", yaw_deg), [*xy, path.height_m])
        for xy, yaw_deg in zip(curve.at(arc), np.degrees(curve.heading_rad(arc)) - 90, strict=True)
    ]


def check_inside(quad: Quad, room: schema.RoomTable | None, field: str) -> Quad:
    """Return a quad with markers, refusing one outside the room."""
    if room is not None:
        corners = quad.panels_m.reshape(-1, 3)
        if not ((corners >= np.array(room.min_m) - 1e-9) & (corners <= np.array(room.max_m) + 1e-9)).all():
            center = ", ".join(f"{c:.3g}" for c in quad.world_from_quad[:3, 3])
            raise SceneError(
                f"{field}: expected markers inside the room {list(room.min_m)}…{list(room.max_m)}, "
                f"{quad.name!r} is at ({center})"
            )
    return quad


# --- furniture ------------------------------------------------------------------------------------------------


def build_meshes(
    boxes: tuple[schema.BoxTable, ...], tables: tuple[schema.DeskTable, ...], materials: Materials = PLAIN
) -> tuple[Mesh, ...]:
    """Return the boxes and desks as triangle meshes."""
    return (
        *(
            _mesh(
                table, [(table.size_m, (0.0, 0.0, table.size_m[2] / 2))], material_of(table, materials, f"boxes[{i}]")
            )
            for i, table in enumerate(boxes)
        ),
        *(
            _mesh(table, list(_desk_parts(table)), material_of(table, materials, f"tables[{i}]"))
            for i, table in enumerate(tables)
        ),
    )


def _desk_parts(table: schema.DeskTable) -> Iterator[tuple[tuple[float, float, float], tuple[float, float, float]]]:
    """Yield (size, centre) of the top and the four legs, metres."""
    width, depth, height = table.size_m
    leg, leg_height = table.leg_m, height - table.top_m
    yield (width, depth, table.top_m), (0.0, 0.0, height - table.top_m / 2)
    for x in (-1, 1):
        for y in (-1, 1):
            yield (leg, leg, leg_height), (x * (width - leg) / 2, y * (depth - leg) / 2, leg_height / 2)


@needs_extra
def _mesh(table: schema.BoxTable | schema.DeskTable, parts: list[tuple[Any, Any]], material: Material) -> Mesh:
    import trimesh

    solid = trimesh.util.concatenate(
        [trimesh.creation.box(size, trimesh.transformations.translation_matrix(center)) for size, center in parts]
    )
    pose = compose(rotation_about("z", table.yaw_deg), table.center_m)
    return Mesh(table.name, np.array(solid.vertices), np.array(solid.faces), pose, (table.level,) * 3, material)


def file_meshes(tables: tuple[schema.MeshTable, ...], folder: Path, materials: Materials = PLAIN) -> Iterator[Mesh]:
    """Yield the meshes of `[[meshes]]`, from files in `folder` or below it, or else among the assets."""
    for i, table in enumerate(tables):
        field = f"meshes[{i}]"
        file = shipped.file_beside(folder, table.file, f"{field}.file")
        x, y, z = (rotation_about(axis, angle) for axis, angle in zip("xyz", table.rotation_deg, strict=True))
        try:
            yield Mesh.from_file(
                file,
                table.name,
                scale=table.scale,
                world_from_mesh=compose(z @ y @ x, table.center_m),
                material=material_of(table, materials, field),
                color=(table.level,) * 3,
                up=table.up,
            )
        except InputError as error:
            raise SceneError(f"{field}.file: {error}") from error


# --- lights and camera ----------------------------------------------------------------------------------------


def build_lights(tables: tuple[schema.AnyLightTable, ...], folder: Path) -> tuple[Light | AreaLight | Environment, ...]:
    """Return the lights; images of surroundings are looked for in `folder`, then among the assets."""
    return tuple(_light(table, folder, f"lights[{i}].file") for i, table in enumerate(tables))


def _light(table: schema.AnyLightTable, folder: Path, field: str) -> Light | AreaLight | Environment:
    if isinstance(table, schema.LightTable):
        return Light(**table.model_dump())
    if isinstance(table, schema.AreaLightTable):
        radiance = WINDOW_RADIANCE if table.radiance is None else table.radiance
        return AreaLight(table.center_m, table.size_m, radiance, table.normal, table.up)
    if table.file is None:
        return Environment(table.radiance, None, table.yaw_deg)
    path = shipped.file_beside(folder, table.file, field)
    try:
        image = read_image(path)
    except InputError as error:
        raise SceneError(f"{field}: {error}") from error
    shares = image / np.iinfo(image.dtype).max
    decoded = linear_from_srgb(shares) if table.curve == "srgb" else shares
    return Environment(table.radiance, decoded.astype(np.float32), table.yaw_deg)


def build_camera(table: schema.CameraTable) -> Camera:
    """Return the camera; focal length and principal point default to square pixels and the image centre."""
    base = _base_camera(table)
    own = {name: getattr(table, name) for name in ("fy", "cx", "cy") if getattr(table, name) is not None}
    built = replace(
        base,
        **own,
        distortion=table.distortion,
        model=table.model,
        row_time_s=table.row_time_s,
        exposure_s=table.exposure_s,
        thin_lens=_thin_lens(table),
    )
    return check_focal_length(built)


def check_focal_length(camera: Camera) -> Camera:
    """Return a camera from a file whose focal length can be one in px.

    Raises
    ------
    SceneError
        If its angle of view would be above 175°, or 360° for a fisheye: lengths in mm, or in image widths, give that.
    """
    most = np.pi if camera.model == "fisheye" else np.tan(np.deg2rad(87.5))
    for name, focal, size in (("fx", camera.fx, camera.width), ("fy", camera.fy, camera.height)):
        least = size / 2 / most
        if focal < least:
            raise SceneError(f"camera: {name}: expected px, at least {least:.3g} for {size} px, got {focal:g}")
    return camera


def _thin_lens(table: schema.CameraTable) -> ThinLens | None:
    if table.focus_m is None:
        return None
    if table.f_number is not None and table.focal_mm is not None:
        return from_f_number(table.focus_m, table.focal_mm, table.f_number)
    return ThinLens(table.focus_m, table.aperture_m or 0.0)


def _base_camera(table: schema.CameraTable) -> Camera:
    """Return the pinhole with square pixels and centred principal point that a table describes."""
    if table.name is not None:
        return camera_named(table.name, table.focal_mm)
    width, height = table.width or 1, table.height or 1
    if table.focal_mm is not None and table.sensor_width_mm is not None:
        return from_sensor(width, height, table.focal_mm, table.sensor_width_mm)
    focal = table.fx or 1.0
    return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)


def build_trajectory(tables: tuple[schema.WaypointTable, ...]) -> Trajectory:
    """Return the camera's trajectory through the waypoints."""
    poses = []
    for i, table in enumerate(tables):
        try:
            poses.append(look_at(table.eye_m, table.target_m))
        except SceneError as error:
            raise SceneError(f"trajectory[{i}]: {error}") from error
    return Trajectory(np.array([table.time_s for table in tables]), np.stack(poses))


def check_camera(tables: tuple[schema.WaypointTable, ...], room: schema.RoomTable | None) -> None:
    """Refuse a camera outside the room, for instance under its floor."""
    for i, table in enumerate(tables):
        if room is not None and not (np.less(room.min_m, table.eye_m) & np.less(table.eye_m, room.max_m)).all():
            raise SceneError(
                f"trajectory[{i}].eye_m: expected a point inside the room "
                f"{list(room.min_m)}…{list(room.max_m)}, got {list(table.eye_m)}"
            )
