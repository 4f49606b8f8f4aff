"""The cameras of a corpus: few and drawn once, so that each has one calibration file."""

from dataclasses import dataclass

from peaksim.camera.camera import Camera
from peaksim.corpus.draws import Draws, corpus_draws
from peaksim.corpus.spec import CameraChoice, CorpusSpec
from peaksim.corpus.spread import Spread
from peaksim.errors import SceneError
from peaksim.scene.build_camera import check_focal_length


@dataclass(frozen=True)
class NamedCamera:
    """A camera, the name of its calibration file, and its weight when one is drawn."""

    name: str
    camera: Camera
    weight: float


def drawn_cameras(spec: CorpusSpec) -> tuple[NamedCamera, ...]:
    """Return the cameras of `[[cameras]]`; none if every scene keeps its own.

    Raises
    ------
    SceneError
        If a drawn camera is impossible, such as one whose distortion folds the image.
    """
    draws = corpus_draws(spec.seed)
    return tuple(
        NamedCamera(name, _drawn_camera(choice, draws, name), choice.weight)
        for choice in spec.cameras
        for name in choice.names
    )


def _drawn_camera(choice: CameraChoice, draws: Draws, name: str) -> Camera:
    def value(field: str, spread: Spread | None, default: float) -> float:
        return default if spread is None else draws.value(f"cameras.{name}.{field}", spread)

    fx = value("fx", choice.fx, 0.0)
    try:
        drawn = Camera(
            width=choice.width,
            height=choice.height,
            fx=fx,
            fy=value("fy", choice.fy, fx),
            cx=value("cx", choice.cx, (choice.width - 1) / 2),
            cy=value("cy", choice.cy, (choice.height - 1) / 2),
            distortion=tuple(value(f"distortion{k}", spread, 0.0) for k, spread in enumerate(choice.distortion)),
            model=choice.model,
        )
        return check_focal_length(drawn)
    except SceneError as error:
        raise SceneError(f"cameras.{name}: {error}") from error
