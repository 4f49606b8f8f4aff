"""What there is to see: quads with textures, meshes and lights, as plain frozen values."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peaksim.errors import SceneError
from peaksim.geometry.pose import Pose, rigid, transform
from peaksim.notices import notice_once
from peaksim.scene.bend import Bend
from peaksim.scene.lamps import AreaLight, Environment
from peaksim.scene.material import PRINT, Material
from peaksim.scene.mesh_file import Up, read_mesh
from peaksim.scene.skin import Skin
from peaksim.scene.texture import Texture

_Kind = TypeVar("_Kind")


@dataclass(frozen=True, eq=False)
class Mark:
    """One printed marker on a quad; truth has a record of each."""

    name: str
    """Unique name in the scene."""
    kind: str
    """Free label of the printed pattern, such as "surf-dark"; the simulator does not interpret it."""
    side_m: float
    """Side of the pattern's square without border, metres."""
    center_m: tuple[float, float] = (0.0, 0.0)
    """Centre in the quad's frame (x right, y up), metres; axes are parallel to the quad's."""

    def __post_init__(self) -> None:
        name = f"marker {self.name!r}"
        if not _floats(self.side_m, (), f"{name}: side_m") > 0:
            raise SceneError(f"{name}: side_m: expected a positive number, got {self.side_m!r}")
        _floats(self.center_m, (2,), f"{name}: center_m")


@dataclass(frozen=True, eq=False)
class Quad:
    """A printed rectangle, flat or bent; its frame is x right, y up, z out of the print, origin at the centre."""

    name: str
    """Unique name in the scene."""
    texture: Texture
    """Stretched over the whole quad; row 0 is at the top (+y)."""
    size_m: tuple[float, float]
    """Width and height, metres."""
    world_from_quad: Pose
    """(4, 4) pose."""
    marker: str | Mark | tuple[Mark, ...] | None = None
    """What is printed on it. A string is the kind of one marker that fills the quad's shorter side."""
    material: Material = PRINT
    """Of the printed face."""
    bend: Bend | None = None
    """How the paper is bent, None for flat: its middle stays where it is, and lengths on the print stay."""

    def __post_init__(self) -> None:
        size_m = _numbers(self.size_m, (2,), f"quad {self.name!r}: size_m")
        if not ((size_m > 0) & (size_m < np.inf)).all():
            raise SceneError(f"quad {self.name!r}: size_m: expected two positive numbers, got {self.size_m!r}")
        if not isinstance(self.texture, Texture):
            raise SceneError(f"quad {self.name!r}: texture: expected a Texture, got {type(self.texture).__name__}")
        if self.bend is not None:
            self.bend.checked(self.size_m, f"quad {self.name!r}")
        object.__setattr__(self, "marker", _marks(self.marker, f"quad {self.name!r}: marker"))
        object.__setattr__(self, "world_from_quad", rigid(self.world_from_quad, f"quad {self.name!r}: pose"))

    @property
    def marks(self) -> tuple[Mark, ...]:
        """The printed markers, in whichever form `marker` states them."""
        if self.marker is None:
            return ()
        if isinstance(self.marker, str):
            return (Mark(self.name, self.marker, min(self.size_m)),)
        return (self.marker,) if isinstance(self.marker, Mark) else self.marker

    @property
    def corners_m(self) -> NDArray[np.float64]:
        """(4, 3) world corners: top-left, top-right, bottom-right, bottom-left as seen upright."""
        return rectangle_m(self, (0.0, 0.0), self.size_m)

    @cached_property
    def panels_m(self) -> NDArray[np.float64]:
        """(n, 4, 3) world corners of the flat rectangles that it is drawn as, from left or top, each as `corners_m`."""
        if self.bend is None:
            return self.corners_m[None]
        return np.asarray(transform(self.world_from_quad, self.bend.panels_m(self.size_m)))

    def points_m(self, xy_m: ArrayLike) -> NDArray[np.float64]:
        """Return the (n, 3) world points of (n, 2) positions on the print: x right, y up, from its middle, metres."""
        xy = np.asarray(xy_m, dtype=np.float64).reshape(-1, 2)
        local = np.column_stack([xy, np.zeros(len(xy))]) if self.bend is None else self.bend.points_m(xy)
        return np.asarray(local @ self.world_from_quad[:3, :3].T + self.world_from_quad[:3, 3])

    def rotation_at(self, xy_m: tuple[float, float]) -> NDArray[np.float64]:
        """Return (3, 3) world directions, in columns, of the print's right, up and normal at a position on it."""
        if self.bend is None:
            return np.asarray(self.world_from_quad[:3, :3])
        normal, straight = self.bend.normals(np.array([xy_m]))[0], np.eye(3)[1 - self.bend.along]
        bent = np.cross(straight, normal) if self.bend.along == 0 else np.cross(normal, straight)
        local = [bent, straight, normal] if self.bend.along == 0 else [straight, bent, normal]
        return np.asarray(self.world_from_quad[:3, :3] @ np.stack(local, axis=1))

    def normals_at(self, xy_m: ArrayLike) -> NDArray[np.float64]:
        """Return the (n, 3) unit normals, world, out of the print at (n, 2) positions on it."""
        xy = np.asarray(xy_m, dtype=np.float64).reshape(-1, 2)
        local = np.tile([0.0, 0, 1], (len(xy), 1)) if self.bend is None else self.bend.normals(xy)
        return np.asarray(local @ self.world_from_quad[:3, :3].T)


def rectangle_m(quad: Quad, center_m: tuple[float, float], size_m: tuple[float, float]) -> NDArray[np.float64]:
    """Return the (4, 3) world corners of a rectangle on the quad's print, from top-left clockwise."""
    x, y = center_m
    w, h = size_m[0] / 2, size_m[1] / 2
    return quad.points_m([[x - w, y + h], [x + w, y + h], [x + w, y - h], [x - w, y - h]])


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh of one colour or with a skin; both sides of its faces are seen."""

    name: str
    """Unique name in the scene."""
    vertices_m: NDArray[np.float64]
    """(n, 3) in the mesh's frame, metres."""
    faces: NDArray[np.int64]
    """(m, 3) vertex indices, counter-clockwise from outside."""
    world_from_mesh: Pose = field(default_factory=lambda: np.eye(4))
    """(4, 4) pose."""
    color: tuple[float, float, float] = (128.0, 128.0, 128.0)
    """Linear grey levels 0…255, RGB, before lighting."""
    material: Material = PRINT
    """Of both sides."""
    skin: Skin | None = None
    """Images and colours of its faces, in place of `color`."""

    def __post_init__(self) -> None:
        name = f"mesh {self.name!r}"
        vertices = _floats(self.vertices_m, (-1, 3), f"{name}: vertices")
        whole = _floats(self.faces, (-1, 3), f"{name}: faces")
        faces = whole.astype(np.int64)
        if len(faces) == 0 or not np.array_equal(faces, whole):
            raise SceneError(f"{name}: faces: expected (m, 3) whole numbers with m ≥ 1, got {self.faces!r}")
        color = _floats(self.color, (3,), f"{name}: color")
        if not ((color >= 0) & (color <= 255)).all():
            raise SceneError(f"{name}: color: expected three grey levels 0…255, got {self.color!r}")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise SceneError(
                f"mesh {self.name!r}: faces: expected indices in 0…{len(vertices) - 1}, got {faces.min()}…{faces.max()}"
            )
        if self.skin is not None:
            object.__setattr__(self, "skin", self.skin.checked(len(faces), name))
        object.__setattr__(self, "color", tuple(color.tolist()))
        object.__setattr__(self, "vertices_m", vertices)
        object.__setattr__(self, "faces", faces)
        object.__setattr__(self, "world_from_mesh", rigid(self.world_from_mesh, f"mesh {self.name!r}: pose"))

    @staticmethod
    def from_file(
        path: str | Path,
        name: str | None = None,
        *,
        scale: float = 1.0,
        world_from_mesh: ArrayLike | None = None,
        material: Material = PRINT,
        color: tuple[float, float, float] = (128.0, 128.0, 128.0),
        up: Up | None = None,
    ) -> "Mesh":
        """Read a mesh with its images and colours from a glTF, GLB, OBJ, PLY or STL file.

        What is dropped or left out, such as faces without area and transparency, is said in one line on stderr.

        Parameters
        ----------
        path
            The file; others that it names must lie in or below its folder.
        name
            Unique name in the scene; by default that of the file, without its ending.
        scale
            Metres a unit of the file, > 0; glTF states metres, the others state nothing.
        world_from_mesh
            (4, 4) pose of the file's origin, by default the world's.
        material
            Of both sides: how the file's levels, which are coded as in images, become reflectance.
        color
            Linear grey levels 0…255, RGB, of faces for which the file states neither image nor colour.
        up
            The file's axis that becomes z: "y" (the default for glTF) or "z" (for all others).

        Raises
        ------
        SceneError, ImageError
            One line that names the file, what was expected and what came.
        """
        if not (isinstance(scale, int | float) and 0 < scale < np.inf):
            raise SceneError(f"{path}: scale: expected a positive number, got {scale!r}")
        found = read_mesh(path, up, color)
        if found.remarks:
            notice_once(f"{path}: left out {', '.join(found.remarks)}")
        vertices, faces = found.corners.reshape(-1, 3) * scale, np.arange(3 * len(found.corners)).reshape(-1, 3)
        pose = np.eye(4) if world_from_mesh is None else rigid(world_from_mesh, f"{path}: pose")
        return Mesh(name or Path(path).stem, vertices, faces, pose, color, material, found.skin)

    @property
    def is_colored(self) -> bool:
        """Whether it shows anything but grey."""
        return len(set(self.color)) > 1 or (self.skin is not None and self.skin.is_colored)

    @property
    def triangles_m(self) -> NDArray[np.float64]:
        """(m, 3, 3) world corners of every face."""
        world = self.vertices_m @ self.world_from_mesh[:3, :3].T + self.world_from_mesh[:3, 3]
        return np.asarray(world[self.faces])


@dataclass(frozen=True, eq=False)
class Light:
    """A light as a multiplier of linear grey levels; a scene without lights is shown as it is printed.

    The multiplier of a surface is the sum over lights of intensity × (1 for ambient, cos of the incidence
    angle for directional, cos × (reference_m / distance)² for point), zero in shadow.
    """

    kind: Literal["ambient", "directional", "point"]
    """Ambient, directional or point."""
    intensity: float
    """Multiplier; 1 keeps a printed grey level at normal incidence."""
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    """World direction in which a directional light travels."""
    position_m: tuple[float, float, float] = (0.0, 0.0, 2.5)
    """World position of a point light."""
    reference_m: float = 1.0
    """Distance at which a point light's multiplier is `intensity`."""
    casts_shadows: bool = True
    """Whether meshes throw shadows in this light."""

    def __post_init__(self) -> None:
        if self.kind not in ("ambient", "directional", "point"):
            raise SceneError(f'light: kind: expected "ambient", "directional" or "point", got {self.kind!r}')
        if not (np.isfinite(self.direction).all() and np.any(self.direction)):
            raise SceneError(f"light: direction: expected a finite direction other than 0, got {self.direction}")
        if not (np.isfinite(self.position_m).all() and 0 <= self.intensity < np.inf and 0 < self.reference_m < np.inf):
            raise SceneError(f"light: expected a finite position, intensity ≥ 0 and reference_m > 0, got {self}")


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that can be seen; names of quads, marks and meshes are unique."""

    quads: tuple[Quad, ...] = ()
    """Flat printed rectangles."""
    meshes: tuple[Mesh, ...] = ()
    """Solid objects of one colour."""
    lights: tuple[Light | AreaLight | Environment, ...] = ()
    """Empty: every surface is shown at its printed grey level."""
    background: float = 128.0
    """Linear grey level where nothing is."""

    @property
    def plain_lights(self) -> tuple[Light, ...]:
        """The lights that every renderer draws; without any, surfaces are shown as printed."""
        return tuple(light for light in self.lights if isinstance(light, Light))

    def __post_init__(self) -> None:
        for many, kind in (("quads", Quad), ("meshes", Mesh), ("lights", (Light, AreaLight, Environment))):
            object.__setattr__(self, many, _all(getattr(self, many), kind, f"scene: {many}"))
        if not 0 <= _floats(self.background, (), "scene: background") <= 255:
            raise SceneError(f"scene: background: expected a grey level 0…255, got {self.background!r}")
        _check_unique([q.name for q in self.quads] + [m.name for m in self.meshes], "names")
        _check_unique([m.name for q in self.quads for m in q.marks], "marker names")


def _check_unique(names: list[str], what: str) -> None:
    twice = sorted(name for name, count in Counter(names).items() if count > 1)
    if twice:
        raise SceneError(f"scene: expected unique {what}, got {twice[0]!r} twice")


def _marks(marker: object, name: str) -> str | Mark | tuple[Mark, ...] | None:
    """Return what a quad has printed on it; a list of marks as a tuple."""
    return marker if marker is None or isinstance(marker, str | Mark) else _all(marker, Mark, name)


def _all(values: Any, kind: type[_Kind] | tuple[type, ...], name: str) -> tuple[_Kind, ...]:
    """Return values as a tuple, refusing what is not all of one type, or of one of several."""
    listed = tuple(values) if isinstance(values, Iterable) else (values,)
    wrong = [value for value in listed if not isinstance(value, kind)]
    if wrong or not isinstance(values, Iterable):
        expected = " or ".join(one.__name__ for one in (kind if isinstance(kind, tuple) else (kind,)))
        raise SceneError(f"{name}: expected a tuple of {expected}, got {type((wrong or [values])[0]).__name__}")
    return listed


def _floats(values: Any, shape: tuple[int, ...], name: str) -> NDArray[np.float64]:
    """Return finite numbers of a shape, as `_numbers`."""
    numbers = _numbers(values, shape, name)
    if not np.isfinite(numbers).all():
        raise SceneError(f"{name}: expected finite numbers, got {values!r}")
    return numbers


def _numbers(values: Any, shape: tuple[int, ...], name: str) -> NDArray[np.float64]:
    """Return numbers of a shape, in which −1 stands for any length, C-contiguous."""
    try:
        numbers = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise SceneError(f"{name}: expected numbers, got {values!r}") from None
    if numbers.ndim != len(shape) or any(n not in (-1, m) for n, m in zip(shape, numbers.shape, strict=True)):
        wanted = "(" + ", ".join("n" if n == -1 else str(n) for n in shape) + ")" if shape else "one"
        raise SceneError(f"{name}: expected {wanted} numbers, got shape {numbers.shape}")
    return numbers
