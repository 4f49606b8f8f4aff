"""Faces in tiles against rays through every pixel corner, and splits against plain NumPy."""

import numpy as np
import pytest
from peaksim import Camera, Quad, Scene, Texture
from peaksim.area.bands import pack_scene
from peaksim.area.cells import PERSPECTIVE, cells_in_tiles, count_splits, faces_in_tiles, tile_boxes
from peaksim.area.faces import DEPTH, FaceViews, view_faces
from peaksim.area.integrate import band_rays
from peaksim.area.owner import MIXED, NOTHING, TILE
from peaksim.area.rays import first_faces, solids_of
from peaksim.geometry.pose import compose, look_at, rotation_about

from tests.peaksim.views import random_view

CAMERA = Camera(100, 24, 90.0)
POSE = look_at([0.3, -2.5, 1.2], [0, 0, 0.2])


def sheets(count: int) -> Scene:
    """Return a floor and small sheets over it, some behind others."""
    rng = np.random.default_rng(count)
    grey = Texture.from_array(np.full((1, 1), 90, np.uint8))
    quads = [Quad("floor", grey, (3.0, 3.0), np.eye(4))]
    for k in range(count):
        turn = rotation_about("x", rng.uniform(0, 90)) @ rotation_about("z", rng.uniform(0, 360))
        position = np.array([*rng.uniform(-1, 1, 2), rng.uniform(0.05, 0.6)])
        quads.append(Quad(f"sheet {k}", grey, (0.3, 0.2), compose(turn, position)))
    return Scene(tuple(quads))


def views_of(scene: Scene) -> FaceViews:
    return view_faces(pack_scene(scene).faces, POSE[None])


@pytest.mark.parametrize("count", [0, 5, 90])
def test_what_a_ray_meets_first_is_among_the_faces_of_its_tile(count: int) -> None:
    scene = sheets(count)
    rays = band_rays(CAMERA, slice(4, 20))
    tiles = faces_in_tiles(views_of(scene), rays, np.arange(count + 1))
    met, _ = first_faces(solids_of(scene, quads=True), POSE[:3, 3], rays.reshape(-1, 3) @ POSE[:3, :3].T)
    met = met.reshape(rays.shape[:2])
    listed = 0
    for tile, (n, alone) in enumerate(zip(tiles.counts, tiles.alone, strict=True)):
        seen = set(met[:, TILE * tile : TILE * tile + TILE + 1].ravel().tolist())
        found = set(tiles.found[tile, :n].tolist())
        assert seen - {-1} <= found
        assert alone == MIXED or seen == {alone if alone != NOTHING else -1}
        listed += n
    assert listed < len(tiles.counts) * (count + 1) or count == 0


def test_boxes_of_tiles_are_the_least_and_largest_directions() -> None:
    rays = band_rays(CAMERA, slice(0, 16)) + np.random.default_rng(1).uniform(-0.1, 0.1, (17, 101, 3))
    boxes = tile_boxes(rays)
    assert boxes.shape == (7, 6)
    for tile, box in enumerate(boxes):
        part = rays[:, TILE * tile : TILE * tile + TILE + 1].reshape(-1, 3)
        assert np.array_equal(box, [*part.min(axis=0), *part.max(axis=0)])


@pytest.mark.parametrize("seed", range(6))
def test_splits_follow_from_the_steepest_textured_face(seed: int) -> None:
    view = random_view(seed, 100, 48)
    packed = pack_scene(view.scene)
    views = view_faces(packed.faces, view.pose[None])
    splits = []
    for first in (0, 16, 32):
        rays = band_rays(view.camera, slice(first, first + 16))
        cells = cells_in_tiles(views, rays)
        assert count_splits(views, rays, cells) == plain_splits(views, rays, cells.owners)
        splits.append(count_splits(views, rays, cells))
    assert np.all(np.array(splits) >= 1)


def plain_splits(views: FaceViews, rays: np.ndarray, owners: np.ndarray) -> tuple[int, int]:
    parts = [1, 1]
    for first in range(0, owners.shape[1], TILE):
        end = min(first + TILE, owners.shape[1])
        shown = np.unique(owners[::5, first:end:5])
        for face in shown[shown >= 0][views.printed[0, shown[shown >= 0]]]:
            w = rays[[0, -1]][:, [first, end]] @ views.sides[0, face, DEPTH]
            nearest = max(w.min(), views.least[face])
            steps = np.abs(w[:, 1] - w[:, 0]).max() / (end - first), np.abs(w[1] - w[0]).max() / (len(rays) - 1)
            parts = [max(p, min(8, int(np.ceil(s / nearest / PERSPECTIVE)))) for p, s in zip(parts, steps, strict=True)]
    return parts[0], parts[1]
