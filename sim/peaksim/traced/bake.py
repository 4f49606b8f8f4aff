"""Light that does not depend on the camera, path-traced once a scene: what surfaces get from still light.

Light that comes straight from lamps and sky changes fast where shadows end: fine texels, each by rays to the lights
from all over it, and many more where some of them are blocked. What surfaces pass on changes slowly: texels `_COARSE`
times larger, by paths in all directions. Straight light of directional and point lights, and ambient light, is left to
the renderer, which draws it with exact edges.
"""

from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from peaksim.area.faces import (
    EXTENT_P,
    EXTENT_Q,
    NORMAL,
    Faces,
    channels_of,
    faces_of,
    panel_counts,
    panels_m,
    triangles_m,
    unit_normals,
)
from peaksim.area.light_map import LightMaps, split_maps
from peaksim.scene.lamps import AreaLight, Environment
from peaksim.scene.material import WHITE
from peaksim.scene.scene import Quad, Scene
from peaksim.scene.texture import Texture
from peaksim.traced.inside import is_inside, is_inside_many
from peaksim.traced.integrate import MAX_DEPTH, STEPS
from peaksim.traced.library import Tools, tools_for
from peaksim.traced.shapes import Traceable, lifts_m, traceable

TEXEL_M = 0.01
"""Side of a texel: shadows are as sharp as this. `LightMaps.detail` states the error that comes of it."""
MOST_TEXELS = 3_000_000
"""Texels are made larger where a scene would need more: 0.4 GB of tables and a minute of two processors."""
_COARSE = 4
"""Texels of indirect light are this much larger."""
_SMOOTH = 1.0
"""Standard deviation of the filter of indirect light, in its texels."""
_BACK = 8
"""Texels of the backs of quads are this much larger than those of their printed faces, for they are seldom seen."""
_LAMP, _PENUMBRA, _SKY, _INDIRECT = 128, 512, 512, 512
"""Samples a texel: rays to a lamp; the same where some are blocked; rays to the sky; paths of indirect light."""
_TEXELS_AT_ONCE = 1 << 20
_PAIRS_AT_ONCE = 1 << 18
_LEAST_LIFT_M = 1e-4
_MANY_FACES = 200
"""Meshes of more faces are asked by rays whether a texel is inside."""
_NEAR_M = 5e-3
"""Quads this close before another one, such as posters, do not darken what they cover: it shows only beside them."""


class Texels(NamedTuple):
    """Texels of light maps, two maps a face: of the side that its normal points to, and of the other."""

    shapes: NDArray[np.int64]
    """(m, 2) rows and columns of each map."""
    frames: NDArray[np.float32]
    """(m, 4, 3) first corner, lifted off the face, both sides, and the unit normal outwards, m."""
    folded: NDArray[np.bool_]
    """(m,) whether a face ends at its third side: texels beyond it show what is nearest on it."""

    @property
    def numbers(self) -> NDArray[np.int64]:
        """(t, 3) map, row and column of each texel."""
        return np.concatenate([np.insert(np.indices(s).reshape(2, -1).T, 0, k, 1) for k, s in enumerate(self.shapes)])

    def split(self, values: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        """Return the (h, w, channels) maps of (t, channels) values."""
        return split_maps(self.shapes, values)


def lit_scene(scene: Scene) -> Scene:
    """Return a scene for baked light: lamps become bright quads, and an even sky the background."""
    white = Texture.from_array(np.full((1, 1), 255, np.uint8))
    lamps = tuple(
        Quad(f"lights[{k}]", white, light.size_m, light.world_from_light)
        for k, light in enumerate(scene.lights)
        if isinstance(light, AreaLight)
    )
    skies = [light.radiance for light in scene.lights if isinstance(light, Environment) and light.image is None]
    background = WHITE * skies[-1] if skies else scene.background
    return replace(scene, quads=(*scene.quads, *lamps), background=background)


def bake_light(scene: Scene, texel_m: float = TEXEL_M, seed: int = 0) -> LightMaps:
    """Return the light of lamps, sky and surroundings on all faces of `lit_scene`, and all indirect light.

    The same arguments give the same bytes on one machine, with one version of Mitsuba and LLVM.

    Raises
    ------
    SceneError
        Where Mitsuba or LLVM is missing.
    """
    faces = faces_of(lit_scene(scene))
    if not len(faces.planes):
        return LightMaps(
            np.zeros((0, 2, 2), np.int64), np.zeros((0, channels_of(scene)), np.float32), texel_m, 0.0, 0.0
        )
    texel_m = max(texel_m, float(np.sqrt(_area_m2(faces, scene) / MOST_TEXELS)))
    fine, coarse = (_texels(faces, scene, side_m) for side_m in (texel_m, _COARSE * texel_m))
    with tools_for(channels_of(scene)) as tools:
        world = traceable(scene)
        halves = [
            (_direct(tools, world, fine, half), _indirect(tools, world, coarse, half))
            for half in (2 * seed, 2 * seed + 1)
        ]
    hidden = [texels.split(_is_inside_solid(scene, texels)) for texels in (fine, coarse)]
    first, second = (_joined(fine.split(direct), coarse.split(indirect), *hidden) for direct, indirect in halves)
    noise = WHITE * float(np.sqrt(((first - second) ** 2).mean())) / 2
    mean = np.asarray((first + second) / 2, dtype=np.float32)
    detail = WHITE * _detail(fine.split(mean))
    return LightMaps(fine.shapes.reshape(-1, 2, 2), _with_lamps(scene, fine, mean), texel_m, noise, detail)


def is_well_formed(maps: LightMaps, scene: Scene) -> bool:
    """Return whether light maps fit the faces and channels of `lit_scene`."""
    faces = len(panels_m(lit_scene(scene).quads)) + sum(len(mesh.faces) for mesh in scene.meshes)
    shapes, texels = maps.shapes, maps.texels
    return (
        shapes.shape == (faces, 2, 2)
        and shapes.dtype == np.int64
        and bool((shapes > 0).all())
        and texels.dtype == np.float32
        and texels.shape == (shapes.prod(axis=2).sum(), channels_of(scene))
        and bool(np.isfinite(texels).all())
    )


# --- texels -----------------------------------------------------------------------------------------------------


def _area_m2(faces: Faces, scene: Scene) -> float:
    """Return the area of fine texels: printed faces, and the parallelograms of both sides of triangles."""
    areas = np.linalg.norm(np.cross(*_sides(faces)), axis=1)
    quads = len(panels_m(scene.quads))
    return float(areas[:quads].sum() + 2 * areas[quads:].sum())


def _sides(faces: Faces) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    across, down = (faces.planes[:, k] * faces.table[:, e, None] for k, e in ((1, EXTENT_P), (2, EXTENT_Q)))
    return across, down


def _texels(faces: Faces, scene: Scene, side_m: float) -> Texels:
    across, down = _sides(faces)
    quads, count = len(panels_m(scene.quads)), len(across)
    lamps = count - quads - sum(len(mesh.faces) for mesh in scene.meshes)
    sides_m = np.full((count, 2), side_m)
    sides_m[:quads, 0] *= _BACK  # the normal of a quad points into the page
    sides_m[quads : quads + lamps] = np.inf
    lengths = np.linalg.norm([down, across], axis=2).T
    shapes = np.maximum(np.ceil(lengths[:, None] / sides_m[:, :, None] - 1e-6), 1).astype(np.int64)
    normals = faces.table[:, None, NORMAL : NORMAL + 3] * [[1], [-1]]
    lifts = np.full((count, 2, 1), _LEAST_LIFT_M)
    lifts[:quads, 1, 0] += np.repeat(lifts_over_near_m(scene.quads), panel_counts(scene.quads))
    corners = faces.planes[:, None, 0] + lifts * normals
    both = np.broadcast_to(across[:, None], corners.shape), np.broadcast_to(down[:, None], corners.shape)
    frames = np.stack([corners, *both, normals], axis=2).reshape(-1, 4, 3).astype(np.float32)
    folded = np.zeros(count, dtype=bool)
    folded[quads + lamps :] = [not flat for flat in _go_on_flat(triangles_m(scene.meshes))]
    return Texels(shapes.reshape(-1, 2), frames, np.repeat(folded, 2))


def _go_on_flat(triangles: NDArray[np.float64]) -> list[bool]:
    """Return of each of (m, 3, 3) triangles whether another one in its plane begins beyond its third side."""
    normals = unit_normals(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    corners = np.round(triangles, 6) + 0.0
    edges: dict[frozenset[tuple[float, ...]], list[int]] = {}
    for k, (a, b, c) in enumerate(corners.tolist()):
        for side in ((a, b), (b, c), (c, a)):
            edges.setdefault(frozenset(map(tuple, side)), []).append(k)
    return [
        any(k != other and normals[k] @ normals[other] > 1 - 1e-6 for other in edges[frozenset(map(tuple, third))])
        for k, third in enumerate(corners[:, 1:].tolist())
    ]


def lifts_over_near_m(quads: tuple[Quad, ...]) -> NDArray[np.float64]:
    """Return (q,) how far points of each printed face are moved off it, to lie before what hangs close before it."""
    moved = lifts_m(quads)
    corners = np.array([quad.corners_m for quad in quads]).reshape(-1, 4, 3)
    lifts = np.zeros(len(quads))
    for k, quad in enumerate(quads):
        local = (corners - quad.world_from_quad[:3, 3]) @ quad.world_from_quad[:3, :3]
        low, high = local[:, :, :2].min(axis=1), local[:, :, :2].max(axis=1)
        reach, away = np.array(quad.size_m) / 2, local[:, :, 2] + moved[:, None]
        near = (np.abs(away).max(axis=1) < _NEAR_M) & ((low < reach) & (high > -reach)).all(axis=1)
        lifts[k] = max(away[near].max(initial=0.0), 0.0)
    return lifts


# --- tracing ----------------------------------------------------------------------------------------------------


def _direct(tools: Tools, world: Traceable, texels: Texels, seed: int) -> NDArray[np.float32]:
    """Return (t, channels) multipliers by light that comes straight from lamps and sky, lamp by lamp.

    All texels send their rays to the same points of a lamp: light is smooth where nothing stands between.
    """
    numbers, delta = texels.numbers, tools.mi.EmitterFlags.Delta
    total = np.zeros((len(numbers), tools.dr.size_v(tools.mi.Spectrum)), dtype=np.float32)
    for k, emitter in enumerate(world.scene.emitters()):
        if not tools.mi.has_flag(emitter.flags(), delta):
            work = Work(tools, world.scene, texels, seed, k)
            light, blocked = _traced(work, numbers, (_SKY if emitter.is_environment() else _LAMP) // 2)
            edges = np.concatenate([_varies(image).ravel() for image in texels.split(blocked)])
            if edges.any() and not emitter.is_environment():
                light[edges], _ = _traced(work, numbers[edges], _PENUMBRA // 2)
            total += light
    return total


def _varies(blocked: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return where more than a trace of light is blocked for some of a texel and its neighbours, and not for others."""
    around = np.ones((3, 3), np.uint8)
    image = np.ascontiguousarray(blocked[:, :, 0])
    return np.asarray(cv2.dilate(image, around) - cv2.erode(image, around) > 0.01) | ((image > 0.01) & (image < 0.99))


def _indirect(tools: Tools, world: Traceable, texels: Texels, seed: int) -> NDArray[np.float32]:
    """Return (t, channels) multipliers by light that other surfaces pass on."""
    light, _ = _traced(Work(tools, world.scene, texels, seed, None), texels.numbers, _INDIRECT // 2)
    return light


class Work(NamedTuple):
    """What is sampled at texels."""

    tools: Tools
    scene: Any
    """Mitsuba's."""
    texels: Texels
    seed: int
    emitter: int | None
    """Light straight from one of the scene's emitters; None: light that other surfaces pass on."""


def _traced(work: Work, numbers: NDArray[np.int64], samples: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the means over the samples of some texels: (t, channels) light, and (t, 1) the share that is blocked."""
    ends = range(0, len(numbers), _TEXELS_AT_ONCE)
    parts = [_mean_light(work, numbers[first : first + _TEXELS_AT_ONCE], samples, first) for first in ends]
    light, blocked = (np.concatenate(part) for part in zip(*parts, strict=True))
    return light, blocked


def _mean_light(
    work: Work, numbers: NDArray[np.int64], samples: int, first: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    (mi, dr), count = work.tools, len(numbers)
    own = np.random.SeedSequence([work.seed, first]).generate_state(6)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(int(own[0]), count)
    if work.emitter is None:
        random = mi.PCG32(count, int(own[1]))
        starts = [random.next_uint32() for _ in STEPS[:4]]
        sample = partial(_passed_on, mi.load_dict({"type": "path", "max_depth": MAX_DEPTH - 1, "rr_depth": 3}))
    else:
        starts = [dr.opaque(mi.UInt32, int(start), count) for start in own[2:]]
        sample = partial(_straight, dr.opaque(mi.UInt32, work.emitter, count))
    point_at, normal = _surface(work, numbers)

    def step(k: Any, total: Any, blocked: Any, sampler: Any) -> tuple[Any, Any, Any, Any]:
        at = [mi.Float((first + k * stride) >> 8) * 2.0**-24 for first, stride in zip(starts, STEPS[:4], strict=True)]
        light, is_blocked = sample(work, sampler, point_at(at[0], at[1]), normal, mi.Point2f(at[2], at[3]))
        return k + 1, total + light, blocked + is_blocked, sampler

    begin = mi.UInt32(0), dr.zeros(mi.Spectrum, count), dr.zeros(mi.Float, count), sampler
    _, total, blocked, _ = dr.while_loop(begin, lambda k, *_: k < samples, step, label="samples of a texel")
    light = np.array(total / samples, dtype=np.float32).reshape(-1, count).T
    return light, np.array(blocked / samples, dtype=np.float32)[:, None]


def _surface(work: Work, numbers: NDArray[np.int64]) -> tuple[Any, Any]:
    """Return the function from two numbers 0…1 to a point of each texel, and the normal there."""
    (mi, dr), texels = work.tools, work.texels
    maps, rows, columns = (mi.UInt32(np.ascontiguousarray(part, dtype=np.uint32)) for part in numbers.T)
    frames, sizes = mi.Float(texels.frames.ravel()), mi.Float(texels.shapes.astype(np.float32).ravel())
    corner, across, down, normal = (dr.gather(mi.Vector3f, frames, 4 * maps + k) for k in range(4))
    height, width = (dr.gather(mi.Float, sizes, 2 * maps + k) for k in range(2))
    is_folded = dr.gather(mi.Bool, mi.Bool(texels.folded), maps)

    def point_at(across_share: Any, down_share: Any) -> Any:
        u, v = (mi.Float(columns) + across_share) / width, (mi.Float(rows) + down_share) / height
        beyond = dr.select(is_folded, dr.maximum(u + v - 1, 0) / 2, 0)
        return mi.Point3f(corner + (u - beyond) * across + (v - beyond) * down)

    return point_at, normal


def _straight(emitter: Any, work: Work, sampler: Any, point: Any, normal: Any, at: Any) -> tuple[Any, Any]:
    """Return the light of a point of an emitter, and 1 where something stands between."""
    mi, dr = work.tools
    here = dr.zeros(mi.SurfaceInteraction3f, dr.width(emitter))
    here.p, here.n = point, mi.Normal3f(normal)
    there, radiance = dr.gather(mi.EmitterPtr, work.scene.emitters_dr(), emitter).sample_direction(here, at, True)
    cosine = dr.dot(there.d, normal)
    shines = (cosine > 0) & (there.pdf > 0)
    blocked = work.scene.ray_test(here.spawn_ray_to(there.p), shines)
    light = dr.select(shines & ~blocked, radiance * (cosine / dr.pi), 0)
    return light, dr.select(blocked, mi.Float(1), mi.Float(0))


def _passed_on(path: Any, work: Work, sampler: Any, point: Any, normal: Any, at: Any) -> tuple[Any, Any]:
    """Return what a surface in some direction shows, lamps left out."""
    mi = work.tools.mi
    direction = mi.Frame3f(normal).to_world(mi.warp.square_to_cosine_hemisphere(at))
    ray = mi.RayDifferential3f(mi.Ray3f(point, direction))
    shown, _, _ = path.sample(work.scene, sampler, ray)
    met = work.scene.ray_intersect(ray)
    return shown - met.emitter(work.scene).eval(met), mi.Float(0)


# --- maps -------------------------------------------------------------------------------------------------------


Images = list[NDArray[np.float32]]


def _joined(direct: Images, indirect: Images, direct_hidden: Images, indirect_hidden: Images) -> NDArray[np.float32]:
    """Return (t, channels) the sum of both kinds of light on fine texels; hidden ones show what is beside them."""
    sums = []
    for near, far, near_hidden, far_hidden in zip(direct, indirect, direct_hidden, indirect_hidden, strict=True):
        height, width, channels = near.shape
        smooth = _smoothed(_spread(far, far_hidden), far_hidden)
        scaled = cv2.resize(smooth, (width, height), interpolation=cv2.INTER_LINEAR).reshape(near.shape)
        sums.append((_spread(near, near_hidden) + scaled).reshape(-1, channels))
    return np.concatenate(sums)


def _smoothed(image: NDArray[np.float32], hidden: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return indirect light without most of its noise: means over neighbours that are not hidden."""
    valid = 1 - hidden
    share = cv2.GaussianBlur(valid, (0, 0), _SMOOTH).reshape(valid.shape)
    mean = cv2.GaussianBlur(image * valid, (0, 0), _SMOOTH).reshape(image.shape) / np.maximum(share, 1e-6)
    return np.asarray(np.where(share > 0.1, mean, image), dtype=np.float32)


def _spread(image: NDArray[np.float32], hidden: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return an image whose (h, w, 1) hidden pixels are means of neighbours, two pixels far, and 0 farther within."""
    if not hidden.any():
        return image
    valid = 1 - hidden
    image = image * valid
    for _ in range(2):
        share = cv2.blur(valid, (3, 3)).reshape(valid.shape)
        around = cv2.blur(image, (3, 3)).reshape(image.shape) / np.maximum(share, 1e-6)
        image = np.where(valid > 0, image, np.where(share > 1e-3, around, 0)).astype(np.float32)
        valid = np.maximum(valid, share > 1e-3).astype(np.float32)
    return image


def _is_inside_solid(scene: Scene, texels: Texels) -> NDArray[np.float32]:
    """Return (t, 1) 1 where the middle of a texel is inside a mesh, else 0."""
    numbers, inside = texels.numbers, np.zeros(len(texels.numbers), dtype=bool)
    share = (numbers[:, :0:-1] + 0.5) / texels.shapes[numbers[:, 0]][:, ::-1]
    frames = texels.frames[numbers[:, 0]]
    points = frames[:, 0] + share[:, :1] * frames[:, 1] + share[:, 1:] * frames[:, 2]
    for mesh in scene.meshes:
        corners = mesh.triangles_m.reshape(-1, 3)
        near = ((points > corners.min(axis=0)) & (points < corners.max(axis=0))).all(axis=1)
        some = np.flatnonzero(near)
        if len(mesh.faces) > _MANY_FACES:
            inside[some] |= is_inside_many(mesh.triangles_m, points[some].astype(np.float64))
            continue
        for part in np.array_split(some, len(some) * len(mesh.faces) // _PAIRS_AT_ONCE + 1):
            inside[part] |= is_inside(mesh.triangles_m, points[part])
    return inside[:, None].astype(np.float32)


def _detail(images: list[NDArray[np.float32]]) -> float:
    """Return half the rms difference of maps to those of half their size."""
    squares, count = 0.0, 1
    for image in images:
        height, width = image.shape[:2]
        if min(height, width) >= 4:
            half = cv2.resize(image, (width // 2, height // 2), interpolation=cv2.INTER_AREA)
            again = cv2.resize(half, (width, height), interpolation=cv2.INTER_LINEAR).reshape(image.shape)
            squares, count = squares + float(((image - again) ** 2).sum()), count + image.size
    return float(np.sqrt(squares / count)) / 2


def _with_lamps(scene: Scene, texels: Texels, values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the values with those of the lamps themselves: bright from before, black from behind."""
    lamps = [light for light in scene.lights if isinstance(light, AreaLight)]
    ambient = sum(light.intensity for light in scene.plain_lights if light.kind == "ambient")
    first = int(texels.shapes[: 2 * len(panels_m(scene.quads))].prod(axis=1).sum())
    for k, lamp in enumerate(lamps):
        values[first + 2 * k : first + 2 * k + 2] = np.array([[0.0], [lamp.radiance]]) - ambient
    return values
