"""The main job end to end, on the shipped scene: figures that the paper claims, files, determinism, bad input."""

import csv
import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from peaksim.camera import apply_sensor, sensor_named
from peaksim.camera.frame import MarkerTruth
from peaksim.rendering import Renderer, render
from peaksim.scene.file import load_scene
from PIL import Image

from peakmark.cli.floor import render_floor
from peakmark.errors import InputError
from peakmark.experiments.floor.flight import map_of
from peakmark.experiments.floor.still import (
    FloorConfig,
    FloorResult,
    figures_of,
    open_scene,
    reasons,
    render_view,
    render_views,
    result_rows,
    run_floor,
    with_opengl,
)
from peakmark.experiments.floor.still_markers import estimated_distances, marker_table
from peakmark.experiments.floor.view import FloorView
from peakmark.identification.stretch import stretched
from peakmark.plain import to_plain
from tests.helpers import needs_gl
from tests.peakmark.cli.running import Run, runner
from tests.peaksim.traced.helpers import needs_tracing

FILES = {"frame.png", "overlay.png", "responses.png", "signatures.png", "report.html", "result.json"}
SMALL_SCENE = """
[camera]
width = 640
height = 480
fx = 550.0
[sensor]
read_noise = 2.0
[[trajectory]]
time_s = 0.0
eye_m = [0.0, 0.2, 0.7]
target_m = [0.0, 1.2, 0.0]
[[trajectory]]
time_s = 1.0
eye_m = [0.0, 0.4, 0.7]
target_m = [0.0, 1.4, 0.0]
[textures.floor]
variants = { gravel = "textures/gravel.png", brick = "textures/brick.png" }
contrast = 0.5
mean = 150
[room]
min_m = [-2.0, 0.0, 0.0]
max_m = [2.0, 4.0, 2.5]
floor = "floor"
[[marker_paths]]
name = "t"
kind = "surf-dark"
count = 3
side_m = 0.08
border_m = 0.01
waypoints_m = [[-0.2, 1.0], [0.15, 1.6]]
"""


def checksums(folder: Path) -> dict[str, str]:
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.glob("*.png")}


@pytest.fixture
def small_scene(tmp_path: Path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(SMALL_SCENE)
    return path


@pytest.fixture(scope="module")
def default_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, FloorResult]:
    out = tmp_path_factory.mktemp("floor")
    return out, run_floor(FloorConfig(), out)


def test_the_papers_claim_on_the_shipped_scene(default_run: tuple[Path, FloorResult]) -> None:
    _, result = default_run
    score = result.score
    assert result.features > 20_000
    assert (score.markers_in_view, score.markers_found) == (14, 14)
    assert score.false_detections == 0
    assert score.false_above_last_marker == 0
    assert score.response_drop is not None
    assert score.response_drop >= 2
    assert score.localisation_px.rms is not None
    assert score.localisation_px.rms <= 1


def test_the_table_says_how_many_responses_stand_above_the_clutter(default_run: tuple[Path, FloorResult]) -> None:
    _, result = default_run
    rows = dict(result_rows(result))
    assert result.markers_above_clutter == 14
    assert result.responses_above_clutter is not None
    assert rows["responses above all clutter"] == f"{result.responses_above_clutter} for 14 markers"
    assert rows["rank before the drop"] == result.responses_above_clutter >= 14
    assert result.score.rank_of_last_marker <= result.responses_above_clutter  # type: ignore[union-attr, operator]


@pytest.fixture
def paper_view(small_scene: Path) -> FloorView:
    config = FloorConfig(str(small_scene), renderer="exact", preset="paper")
    return render_view(open_scene(config), config, 0, 0.0)


def test_distances_from_the_scale_and_refined_lie_near_the_true_ones(small_scene: Path, paper_view: FloorView) -> None:
    estimates = estimated_distances(paper_view, map_of(load_scene(small_scene).scene))
    truth = {marker.name: marker.distance_m for marker in paper_view.frame.truth}
    by_scale, refined = (np.array([estimates[name][k] for name in truth]) for k in (0, 1))
    true = np.array(list(truth.values()))
    assert np.abs(by_scale / true - 1).max() < 0.15
    assert np.median(np.abs(refined.astype(float) / true - 1)) < 0.01
    assert estimated_distances(paper_view, None) == {}


def test_the_papers_preset_keeps_the_stretched_image_and_names_duplicates(
    small_scene: Path, paper_view: FloorView, tmp_path: Path
) -> None:
    result = run_floor(FloorConfig(str(small_scene), renderer="exact", preset="paper"), tmp_path)
    usual = run_floor(FloorConfig(str(small_scene), renderer="exact"), tmp_path)
    assert result.features < usual.features  # of two layers an octave
    drawn = np.asarray(Image.open(tmp_path / "stretched.png"))
    assert np.array_equal(drawn, paper_view.stretched_overlay(2.0))
    gray = stretched(paper_view.frame.image, 2.0)
    assert drawn.shape == (*gray.shape, 3)
    assert (drawn[:, :, 0] == gray).mean() > 0.95  # but for circles and labels
    assert sum(map(len, paper_view.ranks().values())) >= 3
    table = marker_table(paper_view, None)
    ranks = {row[0]: row[list(table.head).index("ranks")] for row in table.rows}
    assert ranks == {name: ", ".join(map(str, of)) for name, of in paper_view.ranks().items()}


def test_every_promised_file_and_figure_is_there(default_run: tuple[Path, FloorResult]) -> None:
    out, result = default_run
    plain = to_plain(result)
    assert {p.name for p in out.iterdir()} == FILES
    assert json.loads((out / "result.json").read_text()) == json.loads(json.dumps(plain))
    assert set(plain) >= {
        "features",
        "markers_in_view",
        "markers_found",
        "false_above_last_marker",
        "response_drop",
        "localisation_px",
        "renderer",
        "gl_renderer",
        "seed",
        "time_s",
        "peak_memory_mb",
    }
    assert set(plain["time_s"]) == {"load", "render", "detect", "identify"}
    assert Image.open(out / "frame.png").size == (2048, 1536)
    assert Image.open(out / "overlay.png").size == (2048, 1536)
    page = (out / "report.html").read_text()
    assert "14 of 14" in page
    assert "http" not in page.replace("http://www.w3.org", "")  # self-contained


@pytest.mark.slow
@pytest.mark.parametrize("texture", ["gravel", "brick", "grass"])
@pytest.mark.parametrize("seed", range(10))
def test_every_floor_and_seed(texture: str, seed: int) -> None:
    config = FloorConfig(texture=texture, seed=seed)
    score = render_view(open_scene(config), config, 0, 0.0).score
    assert (score.markers_found, score.markers_in_view, score.false_above_last_marker) == (14, 14, 0)
    assert score.response_drop is not None
    assert score.response_drop >= 2
    assert score.localisation_px.rms is not None
    assert score.localisation_px.rms <= 1


def test_the_stretch_separates_better_as_the_paper_says(default_run: tuple[Path, FloorResult]) -> None:
    config = FloorConfig(stretch=1.0)
    scores = render_view(open_scene(config), config, 0, 0.0).score, default_run[1].score
    plain, stretched_twice = ((score.markers_found, score.response_drop or 0.0) for score in scores)
    assert plain < stretched_twice
    assert plain[1] < 0.75 * stretched_twice[1]


@pytest.mark.parametrize(
    "renderer",
    ["exact", pytest.param("gl", marks=needs_gl), pytest.param("traced", marks=[needs_tracing, pytest.mark.slow])],
)
def test_the_same_seed_gives_the_same_bytes_and_another_does_not(
    small_scene: Path, tmp_path: Path, renderer: Renderer
) -> None:
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        run_floor(FloorConfig(str(small_scene), renderer=renderer, seed=seed), tmp_path / name)
    assert checksums(tmp_path / "a") == checksums(tmp_path / "b")
    assert checksums(tmp_path / "a")["frame.png"] != checksums(tmp_path / "c")["frame.png"]


def test_several_frames_have_a_row_each_totals_and_a_film_that_plays(small_scene: Path, tmp_path: Path) -> None:
    import av

    result = run_floor(FloorConfig(str(small_scene), renderer="exact", frames=4), tmp_path)
    with (tmp_path / "frames.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["frame"] for row in rows] == ["0", "1", "2", "3"]
    assert result.score.markers_in_view == sum(int(row["markers_in_view"]) for row in rows)
    assert result.score.markers_found == sum(int(row["markers_found"]) for row in rows) == 12
    with av.open(str(tmp_path / "flight.mp4")) as container:
        assert len(list(container.decode(video=0))) == 4
        assert container.streams.video[0].codec_context.name == "h264"


def test_a_frame_does_not_depend_on_the_others(small_scene: Path) -> None:
    setup = load_scene(small_scene)
    config = FloorConfig(str(small_scene), renderer="exact", seed=5)
    alone = render_view(setup, config, 2, 0.5).frame.image
    render_view(setup, config, 0, 0.0)
    assert np.array_equal(render_view(setup, config, 2, 0.5).frame.image, alone)


def resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


@pytest.mark.slow
@pytest.mark.parametrize("renderer", ["exact", pytest.param("gl", marks=needs_gl)])
def test_memory_is_flat_over_200_frames(small_scene: Path, renderer: Renderer) -> None:
    config = FloorConfig(str(small_scene), renderer=renderer, frames=200)
    after_50 = 0.0
    for view in render_views(load_scene(small_scene), config):
        if view.index == 50:
            after_50 = resident_mb()
    assert resident_mb() - after_50 < 20


@pytest.fixture
def script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    return runner(tmp_path, monkeypatch, capfd, "render_floor.py")


def test_the_script_prints_where_to_look(script: Run, small_scene: Path, tmp_path: Path) -> None:
    done = script("--scene", str(small_scene), "--out", str(tmp_path / "o"), "--renderer", "exact")
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip().splitlines()[-1].endswith("o/report.html")
    quiet = script("--scene", str(small_scene), "--out", str(tmp_path / "o"), "--renderer", "exact", "--quiet")
    assert (quiet.returncode, quiet.stdout, quiet.stderr) == (0, "", "")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--texture", "marble"), "textures.floor: expected one of gravel, brick, grass, got 'marble'"),
        (("--scene", "nowhere.toml"), "nowhere.toml: cannot be read"),
        (("--seed", "-1"), "--seed: expected 0 or more, got -1"),
        (("--frames", "0"), "--frames: expected 1…1000000, got 0"),
        (("--stretch", "nan"), "--stretch: expected 0.25…8, got nan"),
        (("--samples", "0"), "--samples: expected 1 or more, got 0"),
        (("--preset", "lowe"), "--preset: expected opencv or paper, got lowe"),
        (("--preset", "paper", "--trajectory", "stroll"), "--preset: expected opencv with --trajectory, got paper"),
        (("--renderer", "povray"), "--renderer: expected auto, exact, gl, pyrender or traced, got povray"),
        (("--out", "/dev/null/x"), "--out /dev/null/x: expected a folder that can be written"),
    ],
)
def test_bad_input_is_one_line_and_status_2_and_leaves_nothing(
    script: Run, tmp_path: Path, arguments: tuple[str, str], message: str
) -> None:
    out = tmp_path / "out"
    done = script("--out", str(out), *arguments) if arguments[0] != "--out" else script(*arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not out.exists()


def test_a_faulty_configuration_is_refused_before_any_work(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--frames"):
        FloorConfig(frames=2_000_000)


def test_the_stretch_is_in_the_table(default_run: tuple[Path, FloorResult]) -> None:
    assert result_rows(default_run[1])[0] == ("stretch", 2.0)
    assert default_run[1].remarks == ()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"surf-dark": "surf-light"}, "only surf-dark is searched for, and there are surf-light"),
        ({"side_m = 0.08": "side_m = 0.02"}, "px in the image, and are found reliably from 20 px on"),
        ({"[-0.2, 1.0], [0.15, 1.6]": "[-1.9, 0.1], [-1.8, 0.15]"}, "no marker of the scene is fully in view"),
    ],
    ids=["light", "small", "out of view"],
)
def test_a_scene_in_which_nothing_is_found_says_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], change: dict[str, str], words: str
) -> None:
    text = SMALL_SCENE
    for before, after in change.items():
        assert before in text
        text = text.replace(before, after)
    (tmp_path / "mine.toml").write_text(text)
    render_floor(scene=str(tmp_path / "mine.toml"), out=tmp_path / "out", renderer="exact")
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["markers_found"] == 0
    if "no marker" not in words:
        assert result["remarks"][0] == f"found 0 of {result['markers_in_view']} markers with stretch 2"
    assert any(words in remark for remark in result["remarks"])
    shown = capsys.readouterr().out
    assert all(f"note: {remark}" in shown for remark in result["remarks"])


@pytest.mark.parametrize(
    ("tilt_deg", "stretch", "advice"),
    [(4.0, 2.0, "--stretch 1"), (60.0, 2.0, None), (60.0, 1.0, "--stretch 2"), (89.9, 2.0, "--stretch 8")],
)
def test_the_stretch_is_doubted_where_the_tilt_implies_another(
    tilt_deg: float, stretch: float, advice: str | None
) -> None:
    seen = MarkerTruth("a", "surf-dark", np.zeros(2), np.zeros((4, 2)), 40.0, 1.0, tilt_deg, 1.0)
    lines = " ".join(reasons([seen], FloorConfig(stretch=stretch)))
    assert ("--stretch" in lines) == (advice is not None)
    assert (advice or "40…40 px in the image") in lines


def test_a_sensor_by_name_takes_the_place_of_the_scenes(small_scene: Path, tmp_path: Path) -> None:
    config = FloorConfig(str(small_scene), renderer="exact", seed=3, sensor="phone")
    setup = open_scene(config)
    assert setup.sensor == sensor_named("phone")
    own = render(setup.scene, setup.camera, setup.trajectory, "exact")
    expected = apply_sensor(own, sensor_named("phone"), np.random.default_rng((3, 0))).image
    assert np.array_equal(render_view(setup, config, 0, 0.0).frame.image, expected)
    with pytest.raises(InputError, match=r"sensor.preset: expected one of machine-vision-linear, .*, got 'telephone'"):
        run_floor(FloorConfig(str(small_scene), sensor="telephone"), tmp_path / "out")
    assert not (tmp_path / "out").exists()


@needs_tracing
def test_lamps_are_baked_unless_that_is_not_wanted(tmp_path: Path) -> None:
    scene = tmp_path / "lamp.toml"
    lamp = """
[[lights]]
kind = "area"
radiance = 8.0
center_m = [0.0, 1.0, 1.0]
size_m = [0.3, 0.3]
[[lights]]
kind = "ambient"
intensity = 0.2
"""
    small = SMALL_SCENE.replace("min_m = [-2.0, 0.0, 0.0]", "min_m = [-0.4, 0.1, 0.0]")
    scene.write_text(small.replace("max_m = [2.0, 4.0, 2.5]", "max_m = [0.4, 2.0, 2.5]") + lamp)
    images = {}
    for bake in (True, False):
        config = FloorConfig(str(scene), renderer="exact", bake=bake)
        images[bake] = render_view(open_scene(config), config, 0, 0.0).frame.linear
    setup = open_scene(config)
    assert np.array_equal(images[False], render(*setup, "exact", bake=False).linear)
    assert np.array_equal(images[True], render(*setup, "exact").linear)
    assert images[True].mean() > 1.1 * images[False].mean()  # half of the image is background


@pytest.mark.parametrize("stretch", [2.0, 1.0])
def test_sift_markers_lie_in_the_places_of_surfs(small_scene: Path, tmp_path: Path, stretch: float) -> None:
    result = run_floor(FloorConfig(str(small_scene), renderer="exact", marker="sift", stretch=stretch), tmp_path)
    assert result.score.markers_in_view == 3
    assert result.score.markers_found == (3 if stretch == 2.0 else result.score.markers_found)
    assert result.score.false_detections == 0
    view = render_view(open_scene(result.config), result.config, 0, 0.0)
    assert {marker.kind for marker in view.frame.truth} == {"sift-dark"}
    assert figures_of(view)["responses"].axes[0].get_title() == "SIFT responses in descending order"
    estimates = estimated_distances(view, map_of(load_scene(small_scene).scene))
    true = {marker.name: marker.distance_m for marker in view.frame.truth}
    assert all(abs(by_scale / true[name] - 1) < 0.2 for name, (by_scale, _) in estimates.items())


def test_sift_knows_the_papers_rule_alone() -> None:
    with pytest.raises(InputError, match="--rule: expected paper with --marker sift, got joint"):
        FloorConfig(marker="sift", rule="joint")


@needs_gl
def test_opengl_draws_the_floor_unless_another_renderer_is_asked_for(default_run: tuple[Path, FloorResult]) -> None:
    assert default_run[1].renderer == "gl"
    rolling = replace(load_scene("floor").camera, row_time_s=1e-5)
    assert with_opengl(FloorConfig(), rolling).renderer == "auto"
    assert with_opengl(FloorConfig(renderer="exact"), replace(rolling, row_time_s=0.0)).renderer == "exact"
