"""Baked light is kept on disk by the hash of its scene, and is made again where the file is of no use."""

import os
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from threading import Barrier
from time import sleep

import numpy as np
import pytest
from peaksim import Camera, Quad, Scene, Texture, render
from peaksim.area.light_map import LightMaps
from peaksim.geometry.pose import compose
from peaksim.scene.lamps import AreaLight
from peaksim.scene.material import Material
from peaksim.traced import light_cache
from peaksim.traced.light_cache import cached_light, light_folder, light_key

from tests.peaksim.scene.boxes import cube
from tests.peaksim.traced.helpers import needs_tracing
from tests.places import ROOT

GREY = Texture.from_array(np.full((4, 4), 90, np.uint8))
SCENE = Scene((Quad("floor", GREY, (1, 1), np.eye(4)),), (cube(0.2),), (AreaLight((0.3, 0, 1), (0.2, 0.2), 9.0),))
TEXEL_M = 0.05
ABOVE = compose(np.diag([1.0, -1.0, -1.0]), [0, 0, 0.9])
CAMERA = Camera(40, 30, 40.0, 40.0, 19.5, 14.5)


@needs_tracing
def test_the_second_time_light_comes_from_the_disk(tmp_path: Path) -> None:
    folder = tmp_path / "light" / "of scenes"
    made, was_there = cached_light(SCENE, TEXEL_M, folder)
    again, is_there = cached_light(replace(SCENE), TEXEL_M, folder)
    assert (was_there, is_there) == (False, True)
    assert all(np.array_equal(value, vars(again)[name]) for name, value in vars(made).items())
    assert [path.name for path in folder.iterdir()] == [f"{light_key(SCENE, TEXEL_M)}.npz"]


@needs_tracing
def test_of_two_that_want_the_same_light_one_bakes_and_the_other_waits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, _ = cached_light(SCENE, TEXEL_M, tmp_path / "other")
    begun, baked = Barrier(2), []

    def bake_slowly(*_: object) -> LightMaps:
        baked.append(1)
        sleep(0.3)
        return made

    def ask() -> bool:
        begun.wait()
        return cached_light(SCENE, TEXEL_M, tmp_path / "light")[1]

    monkeypatch.setattr(light_cache, "bake_light", bake_slowly)
    with ThreadPoolExecutor(2) as threads:
        answers = [asked.result() for asked in [threads.submit(ask), threads.submit(ask)]]
    assert (sorted(answers), len(baked)) == ([False, True], 1)
    assert [path.suffix for path in (tmp_path / "light").iterdir()] == [".npz"]


@needs_tracing
@pytest.mark.parametrize(
    "spoil",
    [lambda content: b"", lambda content: b"no archive", lambda content: content[: len(content) // 2]],
    ids=["empty", "other", "torn"],
)
def test_a_file_that_is_of_no_use_is_made_again(tmp_path: Path, spoil: Callable[[bytes], bytes]) -> None:
    made, _ = cached_light(SCENE, TEXEL_M, tmp_path)
    path = next(tmp_path.iterdir())
    content = path.read_bytes()
    path.write_bytes(spoil(content))
    again, was_there = cached_light(SCENE, TEXEL_M, tmp_path)
    assert not was_there
    assert np.array_equal(made.texels, again.texels)
    assert cached_light(SCENE, TEXEL_M, tmp_path)[1]


@needs_tracing
@pytest.mark.parametrize("name", ["shapes", "texels", "noise"])
def test_values_of_another_form_are_made_again(tmp_path: Path, name: str) -> None:
    made, _ = cached_light(SCENE, TEXEL_M, tmp_path)
    path = next(tmp_path.iterdir())
    values = {**vars(made), name: np.array(["x"], dtype=object) if name == "noise" else vars(made)[name][:-1]}
    np.savez(path, **values)
    assert not cached_light(SCENE, TEXEL_M, tmp_path)[1]


@needs_tracing
def test_where_the_folder_cannot_be_written_light_is_there_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    maps, was_there = cached_light(SCENE, TEXEL_M, tmp_path / "file")
    assert not was_there
    assert maps.texels.max() > 0


@needs_tracing
def test_the_key_is_of_all_that_light_depends_on() -> None:
    floor, box, lamp = SCENE.quads[0], SCENE.meshes[0], SCENE.lights[0]
    assert isinstance(lamp, AreaLight)
    moved = compose(np.eye(3), [0.1, 0, 0])
    lighter = Texture.from_array(np.full((4, 4), 91, np.uint8))
    others = [
        replace(SCENE, quads=(replace(floor, texture=lighter),)),
        replace(SCENE, quads=(replace(floor, size_m=(1, 1.1)),)),
        replace(SCENE, quads=(replace(floor, world_from_quad=moved),)),
        replace(SCENE, quads=(replace(floor, material=Material(curve="srgb")),)),
        replace(SCENE, meshes=(replace(box, world_from_mesh=moved),)),
        replace(SCENE, meshes=(replace(box, color=(1.0, 1.0, 1.0)),)),
        replace(SCENE, meshes=()),
        replace(SCENE, lights=(replace(lamp, radiance=8.0),)),
        replace(SCENE, lights=(lamp, lamp)),
    ]
    keys = [light_key(scene) for scene in (SCENE, *others)] + [light_key(SCENE, 0.02)]
    assert len(set(keys)) == len(keys)
    assert light_key(replace(SCENE, quads=(replace(floor, name="other", marker="kind"),))) == keys[0]


def test_the_folder_is_the_user_s_or_the_one_that_is_stated(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PEAKSIM_CACHE", str(tmp_path))
    assert light_folder() == tmp_path
    monkeypatch.delenv("PEAKSIM_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/home/me/caches")
    assert light_folder() == Path("/home/me/caches/peaksim/light")


@needs_tracing
def test_lamps_are_baked_by_default_and_one_line_says_so_once(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PEAKSIM_CACHE", str(tmp_path))
    scene = replace(SCENE)
    lit = [render(scene, CAMERA, ABOVE, "exact") for _ in range(2)][-1]
    said = capfd.readouterr().err
    assert said.count("peaksim: baked the light of the scene: ") == 1
    assert "leaves out" not in said
    assert 0 < lit.linear.min() < 0.8 * lit.linear.max()
    render(replace(SCENE), CAMERA, ABOVE, "exact")
    assert capfd.readouterr().err == ""


def test_without_mitsuba_one_line_says_what_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "mitsuba.py").write_text("raise ModuleNotFoundError(\"No module named 'mitsuba'\")")
    code = """
import numpy as np
from tests.peaksim.traced.test_light_cache import ABOVE, CAMERA, SCENE
from peaksim import render
frame = render(SCENE, CAMERA, ABOVE, "exact")
print(frame.image[0, 0])
"""
    env = {**os.environ, "PYTHONPATH": f"{tmp_path}:{ROOT}:{ROOT / 'src'}:{ROOT / 'sim'}"}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True)
    assert done.stdout == "90\n"
    how = "needs Mitsuba 3: pip install 'peakmark[traced]'"
    assert done.stderr == (
        f'peaksim: the exact renderer leaves out area lights; renderer "traced" draws them, which {how}\n'
    )
