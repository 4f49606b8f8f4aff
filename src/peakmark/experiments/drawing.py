"""How an experiment's frames are drawn: renderer, camera, light and seed, which each configuration takes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

from numpy.typing import ArrayLike
from peaksim.camera.camera import Camera
from peaksim.camera.frame import Frame
from peaksim.geometry.trajectory import Trajectory
from peaksim.rendering import Renderer, render
from peaksim.scene.scene import Scene

from peakmark.experiments.option import check_choice, check_range


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """What the configurations of rendered experiments share."""

    renderer: Renderer = "auto"
    """"exact", "gl", "pyrender", "traced" or "auto"."""
    samples: int = 64
    """Paths a pixel of the traced renderer, samples of pyrender."""
    sensor: str | None = None
    """Camera by name, see `peaksim.camera.presets`; None takes the scene's own sensor."""
    bake: bool = True
    """Whether "exact" and "gl" show the light of lamps and sky, baked once a scene."""
    seed: int = 0
    """Of all that is random; a frame's streams derive from (seed, its numbers)."""

    def __post_init__(self) -> None:
        check_range("seed", self.seed, 0)
        check_choice("renderer", self.renderer, get_args(Renderer))
        check_range("samples", self.samples, 1)

    def frame(
        self,
        scene: Scene,
        camera: Camera,
        world_from_camera: ArrayLike | Trajectory,
        time_s: float,
        seeds: Sequence[int],
    ) -> Frame:
        """Return a frame before the sensor, see `peaksim.rendering.render`."""
        return render(scene, camera, world_from_camera, self.renderer, time_s, self.samples, seeds, bake=self.bake)
