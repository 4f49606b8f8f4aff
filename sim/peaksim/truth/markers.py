"""Where every marker is in an image, from the posed camera's own projection and exact ray casting."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from peaksim.area.faces import panel_counts, panels_m, triangles_m
from peaksim.area.rays import first_faces, solids_of
from peaksim.camera.camera import Camera
from peaksim.camera.frame import MarkerTruth
from peaksim.camera.shutter import PosedCamera
from peaksim.geometry.polygon import clip_polygon, polygon_area
from peaksim.geometry.pose import invert, transform
from peaksim.native import function
from peaksim.scene.scene import Mark, Quad, Scene, rectangle_m
from peaksim.truth.outline import part_before, seen_outline
from peaksim.truth.shape import CIRCLE, affinities, ellipses, rims_m

if TYPE_CHECKING:
    from peaksim.area.rays import Solids

_SAMPLES = 48
"""Points along each side of a marker at which its visibility is tested: 2304 in all, an error of about 0.004."""
_CLOSE_SAMPLES = 192
"""The same for the part in the image of a marker that reaches behind the camera, which may be cut to a sliver."""
_BESIDE = np.cos(np.radians(89))
"""A corner more than 89° off the axis counts as behind the camera: its image is 57 focal lengths away."""
_UNIT_SQUARE = np.array([[0.0, 0.0], [1, 0], [1, 1], [0, 1]])
OUTLINE_POINTS = 16
"""Points a side of the outline of a marker on bent paper."""
_SAME_POINT = 1e-6
"""Share of a distance within which a ray's hit is the point that it was aimed at."""
_MOMENTS = 32
"""Moments of the exposure at which a centre is projected."""
_find_hidden = function(
    "void find_hidden(const f8[nodes,6] boxes, const i8[nodes,2] links, const i8[count] ids, "
    "const f8[count,4,3] faces, const f8[n,eyes_each,3] eyes, const f8[n,4,3] rectangles, const i8[n] numbers, "
    "b1[n] hidden)"
)


def marker_truth(scene: Scene, posed: PosedCamera) -> tuple[MarkerTruth, ...]:
    """Return one record a marker, in the scene's order."""
    owners = np.array([number for number, quad in enumerate(scene.quads) for _ in quad.marks], dtype=np.intp)
    if len(owners) == 0:
        return ()
    marks = [mark for quad in scene.quads for mark in quad.marks]
    corners = np.array(
        [rectangle_m(quad, mark.center_m, (mark.side_m, mark.side_m)) for quad in scene.quads for mark in quad.marks]
    )
    centers, normals = corners.mean(axis=1), np.array([scene.quads[k].world_from_quad[:3, 2] for k in owners])
    squares, rims = corners.copy(), rims_m(corners)
    bent = [k for k, owner in enumerate(owners) if scene.quads[owner].bend is not None]
    for k in bent:
        centers[k], normals[k], squares[k], rims[k] = _on_bent(scene.quads[owners[k]], marks[k])
    centers_xy, corners_xy = posed.project(centers), posed.project(corners.reshape(-1, 3)).reshape(-1, 4, 2)
    eyes = posed.row_poses(np.nan_to_num(centers_xy[:, 1]))[:, :3, 3]
    distances = np.linalg.norm(eyes - centers, axis=1)
    cosines = ((eyes - centers) * normals).sum(axis=1) / np.maximum(distances, 1e-300)
    tilts_deg = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    in_camera = transform(invert(posed.pose), corners)
    shares = _visible_fractions(scene, posed, owners, (corners, corners_xy, in_camera), cosines > 0)
    outlines = {k: posed.project(outline_m(scene.quads[owners[k]], marks[k])) for k in bent}
    shares[bent] = [bent_visible_fraction(scene, posed, int(owners[k]), marks[k]) for k in bent]
    shapes = affinities(posed, squares), ellipses(posed, rims)
    means, covariances = projection_blur(posed.moments(_MOMENTS) if posed.is_blurred else (posed,), centers)
    return tuple(
        MarkerTruth(
            name=mark.name,
            kind=mark.kind,
            center_xy=centers_xy[k],
            corners_xy=corners_xy[k],
            outline_xy=outlines.get(k, corners_xy[k]),
            side_px=_side_px(posed.camera, outlines.get(k, corners_xy[k]), in_camera[k]),
            distance_m=float(distances[k]),
            tilt_deg=float(tilts_deg[k]),
            visible_fraction=float(shares[k]),
            affinity=shapes[0][k],
            ellipse=shapes[1][k],
            blur_mean_xy=means[k],
            blur_covariance_px2=covariances[k],
        )
        for k, mark in enumerate(marks)
    )


def _on_bent(
    quad: Quad, mark: Mark
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return a marker's centre, normal there, corners of the square that touches it there, and rim, on bent paper."""
    center = np.array([mark.center_m])
    rim = quad.points_m(center + CIRCLE * [1, -1] * mark.side_m)
    point, normal = quad.points_m(center)[0], quad.normals_at(center)[0]
    step = 1e-6 * mark.side_m
    right, up = ((quad.points_m(center + d) - quad.points_m(center - d))[0] for d in ([step, 0], [0, step]))
    right, up = (mark.side_m / 2 * v / np.linalg.norm(v) for v in (right, up))
    return point, normal, point + np.array([up - right, up + right, right - up, -up - right]), rim


def outline_m(quad: Quad, mark: Mark) -> NDArray[np.float64]:
    """Return (4·OUTLINE_POINTS, 3) world points around a marker's pattern, from its top left corner clockwise."""
    ends = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]]) * mark.side_m / 2 + mark.center_m
    steps = (np.arange(OUTLINE_POINTS) / OUTLINE_POINTS)[:, None]
    sides = [start + steps * (end - start) for start, end in zip(ends, np.roll(ends, -1, axis=0), strict=True)]
    return quad.points_m(np.concatenate(sides))


def _side_px(camera: Camera, corners_xy: NDArray[np.float64], in_camera: NDArray[np.float64]) -> float:
    """Return the square root of a square's image area; of the part in the image where a corner has no image."""
    area = polygon_area(corners_xy)
    if np.isnan(area):
        outline = seen_outline(camera, in_camera)
        area = polygon_area(outline) if len(outline) else np.nan
    return float(np.sqrt(abs(area)))


def face_corners_m(scene: Scene) -> NDArray[np.float64]:
    """Return the (f, 4, 3) world corners of all faces, panels first; a triangle's last corner is repeated."""
    return np.concatenate([panels_m(scene.quads), triangles_m(scene.meshes)[:, [0, 1, 2, 2]]])


def projection_blur(
    moments: tuple[PosedCamera, ...], points_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the (n, 2) mean and (n, 2, 2) covariance of the projections of (n, 3) points over some moments."""
    paths_xy = np.stack([moment.project(points_m) for moment in moments])
    away = paths_xy - paths_xy.mean(axis=0)
    return paths_xy.mean(axis=0), np.einsum("tni,tnj->nij", away, away) / len(paths_xy)


# --- what is hidden -------------------------------------------------------------------------------------------


def _visible_fractions(
    scene: Scene,
    posed: PosedCamera,
    owners: NDArray[np.intp],
    rectangles: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    facing: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Return the visible shares of rectangles on quads of index `owners`: without rays where certain.

    `rectangles` are their corners: (n, 4, 3) in the world, (n, 4, 2) px, and (n, 4, 3) in the camera's frame.
    """
    corners, corners_xy, in_camera = rectangles
    solids = solids_of(scene, quads=True)
    behind = _reach_behind(posed, corners_xy, in_camera)
    seen = np.array([_may_be_seen(posed, *rectangle) for rectangle in zip(in_camera, corners_xy, strict=True)]) & facing
    shares, counts = np.zeros(len(corners)), panel_counts(scene.quads)
    first_panels = np.cumsum(counts) - counts
    numbers = first_panels[owners]
    hidden_ones = np.zeros(len(corners), dtype=bool)
    hidden_ones[seen] = find_hidden(scene, posed, numbers[seen], corners[seen], corners_xy[seen])
    for k in np.flatnonzero(seen):
        number, hidden = int(numbers[k]), bool(hidden_ones[k])
        if behind[k]:
            shares[k] = _printed_share(posed, solids, number, corners[k], in_camera[k], hidden)
            continue
        share = None if hidden else _share_inside(posed, corners_xy[k])
        shares[k] = visible_fraction(posed, solids, number, corners[k]) if share is None else share
    return shares


def _reach_behind(
    posed: PosedCamera, corners_xy: NDArray[np.float64], in_camera: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return (n,) which rectangles have a corner behind the camera, or so nearly that its image is far away."""
    if posed.camera.model != "brown":
        return np.zeros(len(in_camera), dtype=bool)
    behind = (in_camera[:, :, 2] <= _BESIDE * np.linalg.norm(in_camera, axis=2)).any(axis=1)
    return np.asarray(behind | (posed.is_rolling & np.isnan(corners_xy).any(axis=(1, 2))))


def _printed_share(
    posed: PosedCamera,
    solids: "Solids",
    number: int,
    corners: NDArray[np.float64],
    in_camera: NDArray[np.float64],
    hidden: bool,
) -> float:
    """Return the share of a rectangle's printed area that is seen: the image of what is behind us has no area."""
    low, high = np.zeros(2), np.ones(2)
    if not posed.is_rolling:
        part = part_before(posed.camera, np.hstack([in_camera, _UNIT_SQUARE]))[:, 3:]
        if len(part) < 3:
            return 0.0
        if posed.camera.is_pinhole and not hidden:
            return abs(polygon_area(part))
        low, high = part.min(axis=0), part.max(axis=0)
    seen = _seen_points(posed, solids, number, _grid(corners, low, high, _CLOSE_SAMPLES))
    return float(seen.mean() * (high - low).prod())


def _share_inside(posed: PosedCamera, corners_xy: NDArray[np.float64]) -> float | None:
    """Return the share of a rectangle's image area in the image, None where its sides bend or pass behind us."""
    if _is_inside(posed, corners_xy):
        return 1.0
    if posed.is_rolling or not posed.camera.is_pinhole or not np.isfinite(corners_xy).all():
        return None
    end = np.array([posed.camera.width, posed.camera.height]) - 0.5
    return polygon_area(clip_polygon(corners_xy, (-0.5, -0.5), end)) / polygon_area(corners_xy)


def find_hidden(
    scene: Scene,
    posed: PosedCamera,
    numbers: NDArray[np.int64],
    corners: NDArray[np.float64],
    corners_xy: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Return (n,) whether anything may lie between rectangles and the camera; False is certain.

    `numbers` are the faces that the (n, 4, 3) rectangles lie on: of other faces in their plane the later ones are
    shown. A rolling shutter looks from where it reads a rectangle's first row and its last one.
    """
    hidden = np.ones(len(numbers), dtype=bool)
    known = np.isfinite(corners_xy).all(axis=(1, 2)) | (not posed.is_rolling)
    rows = np.stack([corners_xy[known, :, 1].min(axis=1), corners_xy[known, :, 1].max(axis=1)], axis=1)
    eyes = posed.row_poses(rows.ravel())[:, :3, 3]
    eyes = eyes.reshape(-1, 2, 3) if posed.is_rolling else np.broadcast_to(eyes, (len(rows), 1, 3))
    found, solids = np.empty(len(rows), dtype=bool), solids_of(scene, quads=True)
    _find_hidden(*solids[:2], solids.ids, face_corners_m(scene), eyes, corners[known], numbers[known], found)
    hidden[known] = found
    return hidden


def _may_be_seen(posed: PosedCamera, in_camera: NDArray[np.float64], corners_xy: NDArray[np.float64]) -> bool:
    """Return whether a rectangle may be in the image; False is certain."""
    camera = posed.camera
    if posed.is_rolling:
        return True
    if camera.model == "brown" and bool((in_camera[:, 2] <= 0).all()):
        return False
    low, high = _bounds(camera, corners_xy, bends=not camera.is_pinhole)
    end = np.array([camera.width, camera.height]) - 0.5
    return not bool(np.any(high <= -0.5) or np.any(low >= end))


def _is_inside(posed: PosedCamera, corners_xy: NDArray[np.float64]) -> bool:
    """Return whether a rectangle is certainly in the image as a whole."""
    camera = posed.camera
    low, high = _bounds(camera, corners_xy, bends=posed.is_rolling or not camera.is_pinhole)
    end = np.array([camera.width, camera.height]) - 0.5
    return bool(np.all(low >= -0.5) and np.all(high <= end))


def _bounds(
    camera: Camera, corners_xy: NDArray[np.float64], bends: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the upper left and lower right of a box around a rectangle's image; nan where that is not certain.

    A lens or a rolling shutter bends the sides of a rectangle that is small in the image by far less than a quarter
    of its diameter.
    """
    low, high = corners_xy.min(axis=0), corners_xy.max(axis=0)
    if not bends:
        return low, high
    diameter = float(np.hypot(*(high - low)))
    slack = 0.25 * diameter if diameter < min(camera.width, camera.height) / 2 else np.nan
    return low - slack, high + slack


def visible_fraction(posed: PosedCamera, solids: "Solids", number: int, corners: NDArray[np.float64]) -> float:
    """Return the share of a rectangle's image area that is inside the image and in front of all else.

    The rectangle is sampled evenly; each sample counts by the image area that it stands for.
    """
    points = _grid(corners, np.zeros(2), np.ones(2), _SAMPLES)
    weights = area_weights(posed, points, corners)
    seen = _seen_points(posed, solids, number, points)
    return float(weights[seen].sum() / total) if (total := weights.sum()) > 0 else 0.0


def bent_visible_fraction(scene: Scene, posed: PosedCamera, number: int, mark: Mark) -> float:
    """Return the share of the image area of a marker on bent paper, quad `number`, that is seen.

    Sampled evenly over the print, on the panels that the paper is drawn as; area that faces away is hidden.
    """
    quad = scene.quads[number]
    steps = ((np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5) * mark.side_m
    xy = np.stack(np.meshgrid(steps, steps), axis=2).reshape(-1, 2) + mark.center_m
    points, normals = points_on_panels(quad, xy), quad.normals_at(xy)
    step = 1e-4 * mark.side_m
    along = [
        (posed.project(quad.points_m(xy + d)) - posed.project(quad.points_m(xy - d))) for d in ([step, 0], [0, step])
    ]
    weights = np.nan_to_num(np.abs(along[0][:, 0] * along[1][:, 1] - along[0][:, 1] * along[1][:, 0]))
    at_xy = posed.project(points)
    inside = np.flatnonzero(posed.camera.contains(at_xy))
    eyes = np.broadcast_to(posed.row_poses(at_xy[inside, 1])[:, :3, 3], (len(inside), 3))
    rays = points[inside] - eyes
    faces, reached = first_faces(solids_of(scene, quads=True), eyes, rays)
    counts = panel_counts(scene.quads)
    first = counts[:number].sum()
    is_own = (faces >= first) & (faces < first + counts[number]) & (np.abs(reached - 1) < _SAME_POINT)
    seen = inside[is_own & ((rays * normals[inside]).sum(axis=1) < 0)]
    return float(weights[seen].sum() / total) if (total := weights.sum()) > 0 else 0.0


def points_on_panels(quad: Quad, xy_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (n, 3) world points of (n, 2) positions on a bent quad's print, as its panels show them."""
    assert quad.bend is not None
    panels, along = quad.panels_m, quad.bend.along
    shares = (0.5 + xy_m / quad.size_m * [1, -1]).clip(0, 1)
    at = shares[:, along] * len(panels)
    number = np.minimum(at.astype(int), len(panels) - 1)
    shares[:, along] = at - number
    top_left, top_right, _, bottom_left = np.moveaxis(panels[number], 1, 0)
    return np.asarray(top_left + shares[:, :1] * (top_right - top_left) + shares[:, 1:] * (bottom_left - top_left))


def _grid(
    corners: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """Return the (count², 3) middles of equal patches of a rectangle between two points, in sides."""
    steps = (np.arange(count) + 0.5) / count
    u, v = (grid.ravel()[:, None] for grid in np.meshgrid(*(low + steps[:, None] * (high - low)).T))
    return np.asarray(corners[0] + u * (corners[1] - corners[0]) + v * (corners[3] - corners[0]))


def _seen_points(posed: PosedCamera, solids: "Solids", number: int, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return (n,) whether points on a face are inside the image and in front of all else."""
    xy = posed.project(points)
    inside = posed.camera.contains(xy)
    eyes = np.broadcast_to(posed.row_poses(xy[inside, 1])[:, :3, 3], (int(inside.sum()), 3))
    seen = np.zeros(len(points), dtype=bool)
    seen[inside] = first_faces(solids, eyes, points[inside] - eyes)[0] == number
    return seen


def area_weights(posed: PosedCamera, points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the image area, in any unit, of equal patches of a plane at (n, 3) points."""
    if posed.camera.is_pinhole and not posed.is_rolling:
        depths_m = (points - posed.pose[:3, 3]) @ posed.pose[:3, 2]
        return np.asarray(np.where(depths_m > 0, depths_m, np.inf) ** -3.0)
    step = 1e-4
    u, v = step * (corners[1] - corners[0]), step * (corners[3] - corners[0])
    along_u = posed.project(points + u) - posed.project(points - u)
    along_v = posed.project(points + v) - posed.project(points - v)
    return np.nan_to_num(np.abs(along_u[:, 0] * along_v[:, 1] - along_u[:, 1] * along_v[:, 0]))
