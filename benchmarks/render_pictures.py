"""The images of the renderer in docs/images/: `python benchmarks/render_pictures.py --out docs/images`."""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from peaksim import Camera, Light, Mesh, Quad, Scene, Texture, Trajectory, load_scene, render
from peaksim.geometry.pose import compose, look_at, rotation_about
from peaksim.shipped import ASSETS
from PIL import Image

CAMERA = Camera(width=480, height=360, fx=400.0, fy=400.0, cx=239.5, cy=179.5)
FISHEYE = Camera(480, 360, 150.0, 150.0, 239.5, 179.5, (-0.02, 0.004, -0.001, 0.0002), model="fisheye")
MARKER = Texture.from_file(ASSETS / "markers/surf-dark.png")
CHEQUER = Texture.from_array((np.add.outer(np.arange(480) // 20, np.arange(800) // 20) % 2 * 175 + 60).astype(np.uint8))


def room() -> Scene:
    """Return a floor of gravel, a chequered wall with a marker, a table and boxes."""
    floor, _, _ = load_scene("floor")
    ground = Quad("floor", floor.quads[0].texture, (6.0, 8.0), np.eye(4))
    upright = rotation_about("x", 90)
    wall = Quad("wall", CHEQUER, (5.0, 3.0), compose(upright, [0, 2.0, 1.5]))
    marker = Quad("marker", MARKER, (0.5, 0.5), compose(upright, [-0.2, 1.99, 1.0]), marker="surf-dark")
    lying = Quad("lying", MARKER, (0.4, 0.4), compose(np.eye(3), [-0.5, 0.6, 0.002]), marker="surf-dark")
    return Scene((ground, wall, marker, lying), furniture(), background=200.0)


def furniture() -> tuple[Mesh, ...]:
    """Return a table and two boxes."""
    import trimesh

    parts = [((1.0, 0.6, 0.04), (0, 0, 0.72))]
    parts += [((0.05, 0.05, 0.7), (x, y, 0.35)) for x in (-0.45, 0.45) for y in (-0.25, 0.25)]
    boxes = [trimesh.creation.box(size, trimesh.transformations.translation_matrix(center)) for size, center in parts]
    table = trimesh.util.concatenate(boxes)
    crate = trimesh.creation.box((0.35, 0.35, 0.35))
    poses = compose(rotation_about("z", 25), [0.6, 0.9, 0]), compose(rotation_about("z", 50), [-0.7, 1.2, 0.175])
    return (
        Mesh("table", table.vertices, table.faces, poses[0], (150.0,) * 3),
        Mesh("crate", crate.vertices, crate.faces, poses[1], (110.0,) * 3),
    )


def images() -> dict[str, np.ndarray]:
    """Return the named images."""
    scene = room()
    flat = replace(scene, meshes=())
    lamps = (Light("ambient", 0.35), Light("point", 1.1, position_m=(-0.6, -0.4, 2.4), reference_m=2.0))
    front = look_at([0.3, -1.6, 1.5], [0.0, 1.2, 0.5])
    grazing = look_at([-1.6, 1.75, 1.0], [0.6, 1.99, 1.0])
    trajectory = Trajectory(
        np.array([-0.5, 0.5]),
        np.stack([front @ compose(rotation_about("y", a), [x, 0, 0]) for a, x in ((-25, -0.6), (25, 0.6))]),
    )
    views = {
        "floor": (flat, CAMERA, look_at([0.0, -2.0, 1.0], [0.0, 0.3, 0.0])),
        "grazing": (flat, CAMERA, grazing),
        "shadows": (replace(scene, lights=lamps), CAMERA, front),
        "fisheye": (replace(scene, lights=lamps), FISHEYE, look_at([0.3, -0.4, 1.5], [0.0, 1.2, 0.5])),
        "rolling_shutter": (flat, replace(CAMERA, row_time_s=3e-4), trajectory),
        "blur": (flat, replace(CAMERA, exposure_s=0.03), trajectory),
    }
    return {name: render(*view, renderer="exact").image for name, view in views.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/images"))
    folder = parser.parse_args().out
    shown = images()
    names = list(shown)
    rows = [np.concatenate([np.pad(shown[n], 4, constant_values=255) for n in names[k : k + 3]], 1) for k in (0, 3)]
    for name, image in shown.items():
        Image.fromarray(image).save(folder / f"render_{name}.jpg", quality=88)
    Image.fromarray(np.concatenate(rows)).save(folder / "render_views.jpg", quality=88)


if __name__ == "__main__":
    main()
