"""Skins that do not fit their mesh."""

import numpy as np
import pytest
from peaksim import Mesh, Texture
from peaksim.errors import SceneError
from peaksim.scene.skin import Skin

GREY, RED = (Texture.from_array(np.full(shape, 200, np.uint8)) for shape in ((2, 2), (2, 2, 3)))
UV = np.zeros((1, 3, 2))


def triangle(skin: Skin) -> Mesh:
    return Mesh("t", np.eye(3), np.array([[0, 1, 2]]), skin=skin)


@pytest.mark.parametrize(
    ("skin", "message"),
    [
        (Skin((GREY,)), "t'?: skin: uv: expected .1, 3, 2. numbers beside textures, got none"),
        (Skin((GREY,), uv=UV[0]), "uv: expected .1, 3, 2. finite numbers, got shape .3, 2."),
        (Skin((GREY,), uv=UV + 1.1), "uv: expected numbers in 0…1, got 1.1…1.1"),
        (Skin((GREY,), uv=UV + np.nan), "uv: expected .* finite"),
        (Skin((GREY,), np.array([1]), UV), "texture_of_face: expected whole numbers in −1…0"),
        (Skin((GREY,), np.array([0.5]), UV), "texture_of_face: expected whole numbers"),
        (Skin(("red",), uv=UV), "textures: expected a tuple of Texture"),  # type: ignore[arg-type]
        (Skin(colors=np.full((1, 3, 3), 256.0)), "colors: expected grey levels 0…255, got 256…256"),
        (Skin(colors=[["a"]]), "colors: expected numbers"),  # type: ignore[arg-type]
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(skin: Skin, message: str) -> None:
    with pytest.raises(SceneError, match=message) as caught:
        triangle(skin)
    assert "\n" not in str(caught.value)


def test_colour_is_noticed() -> None:
    grey, colors = np.full((1, 3, 3), 7.0), np.zeros((1, 3, 3))
    colors[0, 1] = 0, 0, 1
    assert not triangle(Skin(colors=grey)).is_colored
    assert triangle(Skin(colors=colors)).is_colored
    assert not triangle(Skin((GREY,), uv=UV)).is_colored
    assert triangle(Skin((GREY, RED), uv=UV)).is_colored


def test_faces_show_the_first_image_unless_stated() -> None:
    assert Skin((GREY, RED), uv=UV).textured(1).tolist() == [0]
    assert Skin(colors=np.zeros((1, 3, 3))).textured(1).tolist() == [-1]
