"""What there is to see: quads with textures, meshes and lights, as plain frozen values."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from peaksim.errors import SceneError
from peaksim.geometry.pose import Pose, rigid
from peaksim.scene.lamps import AreaLight, Environment
from peaksim.scene.material import PRINT, Material
from peaksim.scene.texture import Texture


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


@dataclass(frozen=True, eq=False)
class Quad:
    """A flat printed rectangle; its frame is x right, y up, z out of the printed face, origin at the centre."""

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

    def __post_init__(self) -> None:
        width, height = self.size_m
        if not (0 < width < np.inf and 0 < height < np.inf):
            raise SceneError(f"quad {self.name!r}: size_m: expected two positive numbers, got {self.size_m}")
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


def rectangle_m(quad: Quad, center_m: tuple[float, float], size_m: tuple[float, float]) -> NDArray[np.float64]:
    """Return the (4, 3) world corners of a rectangle in the quad's plane, from top-left clockwise."""
    x, y = center_m
    w, h = size_m[0] / 2, size_m[1] / 2
    flat = np.array([[x - w, y + h, 0], [x + w, y + h, 0], [x + w, y - h, 0], [x - w, y - h, 0]])
    return np.asarray(flat @ quad.world_from_quad[:3, :3].T + quad.world_from_quad[:3, 3])


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh of one colour; both faces are seen."""

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
    """Of both faces."""

    def __post_init__(self) -> None:
        vertices = np.ascontiguousarray(self.vertices_m, dtype=np.float64)
        faces = np.ascontiguousarray(self.faces, dtype=np.int64)
        if vertices.ndim != 2 or vertices.shape[1:] != (3,) or not np.isfinite(vertices).all():
            raise SceneError(f"mesh {self.name!r}: vertices: expected finite (n, 3), got shape {vertices.shape}")
        if faces.ndim != 2 or faces.shape[1:] != (3,) or len(faces) == 0:
            raise SceneError(f"mesh {self.name!r}: faces: expected (m, 3) with m ≥ 1, got shape {faces.shape}")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise SceneError(
                f"mesh {self.name!r}: faces: expected indices in 0…{len(vertices) - 1}, got {faces.min()}…{faces.max()}"
            )
        object.__setattr__(self, "vertices_m", vertices)
        object.__setattr__(self, "faces", faces)
        object.__setattr__(self, "world_from_mesh", rigid(self.world_from_mesh, f"mesh {self.name!r}: pose"))

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
        _check_unique([q.name for q in self.quads] + [m.name for m in self.meshes], "names")
        _check_unique([m.name for q in self.quads for m in q.marks], "marker names")


def _check_unique(names: list[str], what: str) -> None:
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise SceneError(f"scene: expected unique {what}, got {min(twice)!r} twice")
