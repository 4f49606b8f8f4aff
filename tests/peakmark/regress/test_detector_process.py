"""Detectors in processes: users' functions, OpenCV's features and programs; the bad ones fail on their image alone."""

import os
import sys
import tempfile
from pathlib import Path
from time import monotonic

import cv2
import numpy as np
import pytest

from peakmark.errors import InputError
from peakmark.regress.detector_process import command_of, open_process
from peakmark.regress.detector_protocol import DetectorFailure, Found
from tests.peaksim.corpus.helpers import child_environment

SPOT = np.full((40, 60), 20, np.uint8)
SPOT[11, 33] = 250
DARK = np.zeros((40, 60), np.uint8)


@pytest.fixture(autouse=True)
def children_find_this_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", child_environment()["PYTHONPATH"])


def test_a_users_function_of_key_points_with_parameters() -> None:
    with open_process("tests.user_detectors:brightest", {"size": 9.0}, 10, 30) as detect:
        for _ in range(3):
            found = detect(SPOT)
            assert found.detections is None
            assert found.features.xy.tolist() == [[33, 11]]
            assert (found.features.size[0], found.features.response[0]) == (9, 250)


def test_a_users_function_of_detections() -> None:
    with open_process("tests.user_detectors:detection", {}, 10, 30) as detect:
        (detection,) = detect(SPOT).detections or ()
    assert detection.xy.tolist() == [33, 11]
    assert (detection.polarity, detection.size, detection.response) == ("light", 5.0, 7.5)
    assert (detection.signature_distance, detection.rank) == (0.25, 3)


def in_turn(functions: tuple[str, ...]) -> list[Found]:
    """Return what functions find in one image, all in one process."""
    with open_process("tests.user_detectors:in_turn", {"functions": functions}, 10, 30) as detect:
        return [detect(SPOT) for _ in functions]


def test_every_kind_of_key_points_is_taken() -> None:
    kinds = (
        ("array_of_points", [[33, 11]], [0]),
        ("no_points", [], []),
        ("list_of_pairs", [[33, 11], [3, 4]], [0, 0]),
        ("brightest", [[33, 11]], [0]),
        ("described", [[33, 11]], [0]),
        ("as_opencvs_surf", [[1, 2], [3, 4]], [1, -1]),
        ("our_key_points", [[33, 11]], [-1]),
    )
    functions, *expected = zip(*kinds, strict=True)
    found = in_turn(functions)
    assert [each.detections for each in found] == [None] * len(kinds)
    assert [each.features.xy.tolist() for each in found] == list(expected[0])
    assert [each.features.laplacian.tolist() for each in found] == list(expected[1])


def test_every_kind_of_detections_is_taken() -> None:
    kinds = {"detection_list": "light", "of_numpys_numbers": "light", "without_polarity": None}
    for each, polarity in zip(in_turn(tuple(kinds)), kinds.values(), strict=True):
        (found,) = each.detections or ()
        assert (found.xy.tolist(), found.polarity) == ([33, 11], polarity)


def test_opencvs_features_tell_no_polarity_by_their_numbers() -> None:
    noise = np.random.default_rng(0).integers(0, 255, (100, 100)).astype(np.uint8)
    for name in ("cv2:ORB", "cv2:AKAZE"):
        with open_process(name, {}, 10, 30) as detect:
            found = detect(noise).features
        assert len(found) > 0
        assert not found.laplacian.any()


def test_a_users_function_of_both() -> None:
    with open_process("tests.user_detectors:everything", {}, 10, 30) as detect:
        found = detect(SPOT)
    assert len(found.features) == len(found.detections or ()) == 1


def test_what_a_function_prints_is_no_answer() -> None:
    with open_process("tests.user_detectors:chatty", {}, 10, 30) as detect:
        assert [len(detect(SPOT).features) for _ in range(2)] == [1, 1]


def test_any_feature_of_opencv() -> None:
    noise = np.random.default_rng(0).integers(0, 255, (100, 100)).astype(np.uint8)
    with open_process("cv2:ORB", {"nfeatures": 50}, 10, 30) as detect:
        found = detect(noise).features
    expected = cv2.ORB_create(nfeatures=50).detect(noise, None)
    assert sorted(map(tuple, found.xy.tolist())) == sorted(point.pt for point in expected)
    assert (np.diff(found.response) <= 0).all()


@pytest.mark.parametrize(
    ("function", "words"),
    [
        ("hangs_on_dark", r"timeout: no answer within 2 s"),
        ("dies_on_dark", r"crash: it ended with status 7: out of luck"),
        ("raises_on_dark", r"error: ZeroDivisionError: too dark to see"),
        ("nan_on_dark", r"error: InputError: expected finite positions and responses, got nan"),
    ],
)
def test_a_fault_costs_one_image_and_no_more(function: str, words: str) -> None:
    with open_process(f"tests.user_detectors:{function}", {}, 2, 30) as detect:
        detect(SPOT)
        with pytest.raises(DetectorFailure, match=words) as caught:
            detect(DARK)
        assert "\n" not in str(caught.value)
        assert detect(SPOT).features.xy.tolist() == [[33, 11]]


def test_what_is_no_result_is_an_error() -> None:
    with (
        open_process("tests.user_detectors:wrong_type", {}, 10, 30) as detect,
        pytest.raises(DetectorFailure, match=r"error: InputError: .*expected Keypoints.*got dict"),
    ):
        detect(SPOT)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("no_such_module:f", "no_such_module:f: .*cannot be imported"),
        ("tests.user_detectors:nothing", "cannot be imported"),
        ("tests.user_detectors:SPEED", "cannot be imported"),
        ("cv2:NoSuch", "expected cv2:NAME of a cv2.Feature2D, got 'cv2:NoSuch'"),
        ("exec:/no/such/program --fast", "/no/such/program: cannot be started: No such file"),
        ("exec:", "got no program"),
        ("exec:'", "No closing quotation"),
    ],
)
def test_what_cannot_be_started_is_one_line(name: str, words: str) -> None:
    def start() -> None:
        with open_process(name, {}, 10, 30):
            pass

    with pytest.raises(InputError, match=words) as caught:
        start()
    assert "\n" not in str(caught.value)


# --- programs ---------------------------------------------------------------------------------------------------

PROGRAM = """
import json, sys, time
for line in sys.stdin:
    asked = json.loads(line)
    answer = {"frame": asked["frame"], "detections": [{"x": 3, "y": 4.5}]}
    {FAULT}
    print(json.dumps(answer), flush=True)
"""


def program(folder: Path, fault: str = "pass") -> str:
    """Return the name of a detector that is a program, with a fault on its first image."""
    path = folder / "it's a detector.py"
    path.write_text(PROGRAM.replace("{FAULT}", fault))
    return f'exec:{sys.executable} "{path}"'


def test_a_program_answers_in_json_lines(tmp_path: Path) -> None:
    sees = "from PIL import Image; assert Image.open(asked['image']).size == (asked['width'], asked['height'])"
    with open_process(program(tmp_path, sees), {}, 10, 30) as detect:
        for _ in range(2):
            (detection,) = detect(SPOT).detections or ()
            assert (*detection.xy, detection.polarity) == (3, 4.5, None)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("print('Hello'); sys.stdout.flush()", "rubbish: expected a line of JSON, got 'Hello"),
        ("answer = [1]", "rubbish: expected .*got"),
        ("answer['frame'] += 5", "rubbish: expected"),
        ("del answer['detections']", "rubbish: expected"),
        ("answer['detections'] = 5", "rubbish: detections: expected a list"),
        ("answer['detections'] = [5]", "rubbish: detections: expected points"),
        ("answer['detections'][0]['x'] = float('nan')", "rubbish: detections: x: expected a finite number, got 'nan'"),
        ("answer['detections'][0]['x'] = 'left'", "rubbish: detections: x: expected a finite number, got 'left'"),
        ("del answer['detections'][0]['y']", "rubbish: detections: y: expected a finite number, got 'None'"),
        ("answer['detections'][0]['x'] = 1e300", "rubbish: detections: x: expected at most ±3.4e.38, got '1e.300'"),
        ("answer['detections'][0]['y'] = 10**400", "rubbish: detections: y: expected at most .*got '1000"),
        ("answer['detections'][0]['rank'] = 1.5", "rubbish: detections: rank: expected a whole number, got 1.5"),
        ("answer['detections'][0]['polarity'] = 'Light'", "polarity: expected light, dark or null, got 'Light'"),
        ("answer['detections'][0]['polarity'] = [1]", "polarity: expected light, dark or null, got '.1.'"),
        ("print('[' * 500_000 + ']' * 500_000, flush=True)", "rubbish: expected a line of JSON, got '\\[\\["),
        ("print('9' * 5000, flush=True)", "rubbish: expected a line of JSON, got '999"),
        ("answer['frame'] = False", "rubbish: expected .*got"),
        ("answer = {'frame': 7, 'error': 'of another image'}", "rubbish: expected .*got"),
        ("answer = {'frame': asked['frame'], 'error': 'no licence'}", "error: no licence"),
        (r"answer = {'frame': asked['frame'], 'error': 'a \x1b[2J\x07\ud800 b'}", r"error: a \\x1b\[2J\\x07\\ud800 b$"),
        (r"sys.exit('\x1b]0;title\x07')", r"crash: it ended with status 1: \\x1b\]0;title\\x07$"),
        ("sys.exit('killed by the\\nlawyers')", "crash: it ended with status 1: lawyers"),
        ("time.sleep(99)", "timeout"),
    ],
)
def test_a_programs_fault_costs_one_image(tmp_path: Path, fault: str, words: str) -> None:
    mark = tmp_path / "seen"
    once = f"import os\n    if not os.path.exists({str(mark)!r}):\n        open({str(mark)!r}, 'w'); {fault}"
    with open_process(program(tmp_path, once), {}, 2, 2) as detect:
        with pytest.raises(DetectorFailure, match=words):
            detect(SPOT)
        assert detect(SPOT).detections


@pytest.mark.parametrize(
    "flood",
    [
        "while True: print(' ' * 999, end='', flush=True); time.sleep(0.001)",
        "while True: sys.stderr.write('complaint\\n' * 1000)",
        "import os; os.close(2); time.sleep(99)",
    ],
    ids=["output", "errors", "no errors"],
)
def test_a_flood_ends_with_the_time_limit(tmp_path: Path, flood: str) -> None:
    start = monotonic()
    with (
        open_process(program(tmp_path, flood), {}, 0.5, 0.5) as detect,
        pytest.raises(DetectorFailure, match="timeout"),
    ):
        detect(SPOT)
    assert monotonic() - start < 4


def test_a_detector_that_hangs_has_its_time_to_warm_up_once(tmp_path: Path) -> None:
    with open_process(program(tmp_path, "time.sleep(99)"), {}, 0.2, 1.5) as detect:
        limits = []
        for _ in range(3):
            with pytest.raises(DetectorFailure) as caught:
                detect(SPOT)
            limits.append(str(caught.value))
    assert limits == ["timeout: no answer within 1.7 s", *["timeout: no answer within 0.2 s"] * 2]


def test_a_program_that_does_not_read_is_a_timeout(tmp_path: Path) -> None:
    path = tmp_path / "deaf.py"
    path.write_text('import itertools\nfor i in itertools.count(): print(\'{"frame": %d, "keypoints": []}\' % i)\n')

    def ask_often() -> None:
        with open_process(f"exec:{sys.executable} {path}", {}, 10, 30) as detect:
            for _ in range(2000):
                detect(SPOT)

    with pytest.raises(DetectorFailure, match="timeout: it does not read its requests"):
        ask_often()


def test_nothing_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with open_process("tests.user_detectors:process_id", {}, 10, 30) as detect:
        process = int(detect(SPOT).features.response[0])
        os.kill(process, 0)  # asks whether it lives
        (folder,) = tmp_path.iterdir()
        assert [path.name for path in folder.iterdir()] == []
    assert not list(tmp_path.iterdir())
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


def test_a_detector_may_delete_its_image_and_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with open_process("tests.user_detectors:deletes", {}, 10, 30) as detect:
        assert [len(detect(SPOT).features) for _ in range(2)] == [1, 1]
    assert not list(tmp_path.iterdir())


def test_parameters_that_no_program_gets_are_refused() -> None:
    with pytest.raises(
        InputError, match="detector exec:find: expected no parameters but its own ARGUMENTS, got octaves"
    ):
        command_of("exec:find", {"octaves": 3})


def test_no_shell_reads_a_programs_name() -> None:
    assert command_of("exec:find . ; rm -rf $HOME", {}) == ["find", ".", ";", "rm", "-rf", "$HOME"]
