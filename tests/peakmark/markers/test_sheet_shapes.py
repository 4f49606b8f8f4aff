import numpy as np
import pytest

from peakmark.markers.sheet_shapes import Dog, dog_discs, dog_gray


@pytest.mark.parametrize("polarity", ["dark", "light"])
def test_discs_of_a_dog_step_finely_and_stay_inside(polarity):
    square, *discs = dog_discs(Dog(0, 0, 80.0, 80 / 12, polarity))
    grays = np.array([square.gray, *(disc.gray for disc in discs)])
    radii = np.array([disc.radius_mm for disc in discs])
    assert np.abs(np.diff(grays)).max() < 1.2
    assert (np.diff(radii) < 0).all()
    assert radii[0] <= 40
    assert grays.min() == pytest.approx(0, abs=0.2)
    assert grays.max() == pytest.approx(255, abs=0.2)
    np.testing.assert_allclose(dog_gray(radii / (80 / 12), polarity), grays[1:], atol=1.2)
