"""Photographs of other libraries: as these read them, without importing the slow one."""

import subprocess
import sys

import numpy as np
import pytest

from peakmark.experiments.photographs import load_photograph
from peakmark.keypoints.image import as_gray
from tests.peaksim.corpus.helpers import child_environment


@pytest.mark.parametrize("name", ["china.jpg", "flower.jpg"])
def test_scikit_learns_are_as_it_reads_them(name: str) -> None:
    datasets = pytest.importorskip("sklearn.datasets")
    assert np.array_equal(load_photograph(name), as_gray(datasets.load_sample_image(name)))


def test_reading_one_imports_no_scikit_learn() -> None:
    code = "import sys; from peakmark.experiments.photographs import load_photograph as load\n"
    code += "print(load('china.jpg').shape, load('camera').shape, 'sklearn' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], env=child_environment(), capture_output=True, text=True)
    assert done.stdout == "(427, 640) (512, 512) False\n", done.stderr
