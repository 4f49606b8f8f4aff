"""Corpora of sheets in photographs: as drawn, with full truth, the same bytes however made, from any folder."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from peaksim.corpus import check_corpus, load_spec, make_corpus, open_corpus
from peaksim.corpus.backends import processes
from peaksim.corpus.check_spec import check_spec
from peaksim.corpus.plan import plan_frame
from peaksim.corpus.sample import from_line, make_sample
from peaksim.corpus.spec import CorpusSpec
from peaksim.errors import InputError

from peakmark.regress.run import load_frame
from peakmark.regress.suite import load_suite
from tests.peaksim.corpus.helpers import contents

BASE: dict[str, Any] = {
    "name": "warped",
    "frames": 6,
    "seed": 4,
    "sequence_frames": 2,
    "renderer": "exact",
    "store": {"shard_frames": 2, "part_frames": 6},
    "cameras": [{"name": "cam", "width": 160, "height": 120, "fx": [120, 220], "count": 2}],
    "warped": {"photographs": "photos", "sheets": {"integers": [1, 3]}, "side_px": [12, 30]},
}


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    """A specification's folder with a folder of two photographs, one of them grey."""
    folder = tmp_path / "specs"
    (folder / "photos").mkdir(parents=True)
    rng = np.random.default_rng(0)
    for name, shape in (("a.png", (200, 300)), ("b.jpg", (240, 320, 3))):
        rough = cv2.resize(rng.uniform(30, 220, (12, 16, *shape[2:])).astype(np.float32), shape[1::-1])
        cv2.imwrite(str(folder / "photos" / name), rough.astype(np.uint8))
    (folder / "photos" / "notes.txt").write_text("no image")
    return folder


def spec(**fields: Any) -> CorpusSpec:
    return CorpusSpec.model_validate({**BASE, **fields})


def test_sheets_are_as_large_and_as_tilted_as_drawn_and_wholly_seen(photos: Path) -> None:
    warped = {**BASE["warped"], "side_px": 24, "tilt_deg": 40, "sheets": 3}
    for index in range(6):
        plan = plan_frame(spec(warped=warped), photos, index)
        record = from_line(make_sample(plan, "exact", spec().pictures).record, "")
        assert record["view"] == "warped"
        assert record["scene"] in ("a.png", "b.jpg")
        assert 1 <= len(record["markers"]) <= 3
        for marker in record["markers"]:
            assert marker["side_px"] == pytest.approx(24, rel=0.06)  # perspective and the sheet's own depth
            assert marker["tilt_deg"] == pytest.approx(40, abs=1e-6)
            assert marker["visible_fraction"] == pytest.approx(1, abs=1e-9)
            assert marker["points_seen"] == [2] * 5


@pytest.mark.parametrize("pattern", ["surf", "sift", "sift-range"])
def test_a_marker_lies_where_truth_says(photos: Path, pattern: str) -> None:
    """The dark and light of a pattern, which is point-symmetric, correlate with its turn about the true centre."""
    kinds = [f"{pattern}-dark", f"{pattern}-light"]
    warped = {**BASE["warped"], "side_px": 40, "tilt_deg": 0, "sheets": 1, "border": 0.3, "kinds": kinds}
    plan = plan_frame(spec(warped=warped), photos, 0)
    sample = make_sample(plan, "exact", spec().pictures)
    image = cv2.imdecode(np.frombuffer(sample.image, np.uint8), cv2.IMREAD_GRAYSCALE).astype(np.float32)
    (truth,) = from_line(sample.record, "")["markers"]
    assert truth["kind"] in kinds
    center = np.array(truth["points_xy"][0])

    def difference(shift: np.ndarray) -> float:
        parts = [cv2.getRectSubPix(image, (25, 25), tuple(map(float, center + shift)))]
        return float(np.abs(parts[0] - parts[0][::-1, ::-1]).mean())

    here = difference(np.zeros(2))
    assert all(difference(np.array(shift)) > 1.5 * here for shift in ((0.5, 0), (-0.5, 0), (0, 0.5), (0, -0.5)))


def test_bytes_are_those_of_an_undisturbed_run(photos: Path, tmp_path: Path) -> None:
    make_corpus(spec(), photos, str(tmp_path / "whole"))
    whole = contents(tmp_path / "whole")
    make_corpus(spec(), photos, str(tmp_path / "shared"), processes(1))
    assert contents(tmp_path / "shared") == whole
    for name in ("manifest.json", "sums/shard-000001.sha256", "records/000001.jsonl", "frames/000001/00000003.png"):
        (tmp_path / "shared" / name).unlink()
    made = make_corpus(spec(), photos, str(tmp_path / "shared"))
    assert made.rendered == 1
    assert contents(tmp_path / "shared") == whole
    assert check_corpus(str(tmp_path / "whole"), folder=photos) == []


def test_another_photograph_is_another_corpus(photos: Path, tmp_path: Path) -> None:
    make_corpus(spec(), photos, str(tmp_path / "corpus"))
    cv2.imwrite(str(photos / "photos" / "a.png"), np.full((50, 50), 99, np.uint8))
    with pytest.raises(InputError, match=r"corpus of another configuration: inputs.photographs/a.png"):
        make_corpus(spec(), photos, str(tmp_path / "corpus"))


def test_a_corpus_and_its_specification_are_suites(photos: Path, tmp_path: Path) -> None:
    make_corpus(spec(), photos, str(tmp_path / "corpus"))
    suite = load_suite(str(tmp_path / "corpus"))
    (photos / "suite.toml").write_text(
        """
        name = "photos"
        [corpus]
        name = "warped"
        frames = 6
        seed = 4
        sequence_frames = 2
        renderer = "exact"
        cameras = [{ name = "cam", width = 160, height = 120, fx = [120, 220], count = 2 }]
        warped = { photographs = "photos", sheets = { integers = [1, 3] }, side_px = [12, 30] }
        """,
        encoding="utf-8",
    )
    for frame in range(3):
        read, drawn = load_frame(suite, frame, 4), load_frame(load_suite(str(photos / "suite.toml")), frame, 4)
        assert np.array_equal(read.image, drawn.image)
        assert [m.name for m in read.truth] == [m.name for m in drawn.truth]
    assert open_corpus(str(tmp_path / "corpus")).picture(0).shape == (120, 160, 3)


def test_photographs_default_to_those_of_scikit_image(photos: Path) -> None:
    pytest.importorskip("skimage")
    plan = plan_frame(spec(warped={}), photos, 0)
    assert plan.photograph is not None
    assert plan.photograph.parent.name == "data"


def test_what_is_no_folder_of_photographs_is_refused_in_a_line(photos: Path, tmp_path: Path) -> None:
    (photos / "empty").mkdir()
    for name in ("empty", "nowhere"):
        with pytest.raises(InputError, match=rf"^warped.photographs: expected a folder with images .*, got .*{name}$"):
            check_spec(spec(warped={"photographs": name}), photos)
    (photos / "photos" / "c.png").write_bytes(b"no image")
    with pytest.raises(InputError, match=r"c.png: expected an image .*, found none$"):
        check_spec(spec(), photos)
    with pytest.raises(InputError, match=r"warped.kinds: expected one of .*, got 'surf-grey'"):
        check_spec(spec(warped={**BASE["warped"], "photographs": None, "kinds": ["surf-grey"]}), photos)


def test_the_option_names_any_folder_and_a_file_only_those_below_it(photos: Path, tmp_path: Path) -> None:
    text = """
    name = "w"
    frames = 1
    cameras = [{ name = "cam", width = 160, height = 120, fx = 120 }]
    """
    file = photos / "w.toml"
    file.write_text(text + '[warped]\nphotographs = "../elsewhere"\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"w.toml: warped.photographs: expected a path inside specs/"):
        load_spec(file)
    elsewhere = tmp_path / "elsewhere"
    (photos / "photos").rename(elsewhere)
    assert plan_frame(load_spec(file, photographs=elsewhere), photos, 0).photograph.parent == elsewhere  # type: ignore[union-attr]
    file.write_text(text + 'scenes = [{ file = "floor" }]\nviews = [{ kind = "flight" }]\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"--photographs .*: expected a specification with \[warped\], .* has none"):
        load_spec(file, photographs=elsewhere)
