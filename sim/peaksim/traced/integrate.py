"""The mean radiance of every pixel by path tracing (Kajiya 1986, doi:10.1145/15886.15902).

A pixel's samples are spread evenly over its square, the exposure and the aperture by additive sequences with a random
start of its own (Cranley and Patterson 1976); how a path goes on is drawn anew for each. The pixel is their mean, a box
filter, so that neighbouring pixels share nothing.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from peaksim.area.bands import Levels
from peaksim.area.faces import channels_of
from peaksim.camera.shutter import PosedCamera
from peaksim.errors import SceneError
from peaksim.scene.material import WHITE
from peaksim.scene.scene import Light, Scene
from peaksim.traced.inside import check_lights
from peaksim.traced.library import Tools, tools_for
from peaksim.traced.shapes import Traceable, traceable
from peaksim.traced.view import View, rays, view_of

SAMPLES = 64
"""Paths a pixel."""
MAX_DEPTH = 12
"""Longest path in steps from camera to lamp: 2 is direct light."""
_ROULETTE_DEPTH = 3
"""From this step on Russian roulette ends paths that carry little: in a room as little noise for the time as 5 (the
cave with two lamps: variance × time is 46 at both, 53 at 2), in two thirds of the time a sample."""
MOST_SAMPLES = 1_000_000
_PIXELS_AT_ONCE = 1 << 20
STEPS = tuple(
    round(2**32 * step) | 1
    # Roberts 2018 in the pixel: 1/g and 1/g² of the plastic number g; then fractions of the golden ratio, √2 and √3
    for step in (0.7548776662466927, 0.5698402909980532, 0.6180339887498949, 0.4142135623730951, 0.7320508075688772)
)
"""Of additive sequences, in 2⁻³²: five numbers a sample."""


def integrate(
    scene: Scene, posed: PosedCamera, samples: int = SAMPLES, seed: int | Sequence[int] = 0, max_depth: int = MAX_DEPTH
) -> Levels:
    """Return the (h, w, channels) linear grey levels of a scene, with Monte Carlo noise.

    The same arguments give the same bytes on one machine, with one version of Mitsuba and LLVM.

    Parameters
    ----------
    scene, posed
        What is seen, and by what.
    samples
        Paths a pixel; noise falls with its square root.
    seed
        A number ≥ 0, or several, such as those of a run and of a frame.
    max_depth
        Longest path in steps from camera to lamp, ≥ 2.

    Raises
    ------
    SceneError
        For arguments out of range, a light inside a mesh, and where Mitsuba or LLVM is missing.
    """
    check(samples, seed, max_depth)
    check_lights(scene, posed.pose[:3, 3])
    camera, channels = posed.camera, channels_of(scene)
    rows = max(1, _PIXELS_AT_ONCE // camera.width)
    out = np.empty((camera.height, camera.width, channels), dtype=np.float32)
    with tools_for(channels) as tools:
        traced = traceable(scene)
        path = tools.mi.load_dict({"type": "path", "max_depth": max_depth, "rr_depth": _ROULETTE_DEPTH})
        for first in range(0, camera.height, rows):
            band = slice(first, min(first + rows, camera.height))
            own = np.random.SeedSequence([*np.atleast_1d(seed).tolist(), first]).generate_state(2)
            view = view_of(tools, posed, band)
            pixels = (band.stop - band.start) * camera.width
            mean = _mean_radiance(tools, traced, view, path, pixels, samples, own.tolist(), scene.background / WHITE)
            out[band] = WHITE * np.array(mean).T.reshape(-1, camera.width, channels)
    return out


def check(samples: int, seed: int | Sequence[int], max_depth: int = MAX_DEPTH) -> None:
    """Refuse numbers of samples, seeds and depths that cannot be.

    Raises
    ------
    SceneError
        One line that names the argument.
    """
    for name, value, least, most in (("samples", samples, 1, MOST_SAMPLES), ("max_depth", max_depth, 2, 10_000)):
        if not isinstance(value, int | np.integer) or isinstance(value, bool) or not least <= value <= most:
            raise SceneError(f"{name}: expected a whole number in {least}…{most}, got {value!r}")
    seeds = [seed] if np.ndim(seed) == 0 else list(seed)  # type: ignore[arg-type]
    if not all(isinstance(value, int | np.integer) and value >= 0 for value in seeds):
        raise SceneError(f"seed: expected a whole number ≥ 0, or several, got {seed!r}")


def _mean_radiance(
    tools: Tools, traced: Traceable, view: View, path: Any, pixels: int, samples: int, seeds: list[int], back: float
) -> Any:
    """Return the mean radiance of the pixels of a view, in one kernel."""
    mi, dr = tools
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seeds[0], pixels)
    start = mi.PCG32(pixels, seeds[1])
    starts = [start.next_uint32() for _ in STEPS]
    pixel = dr.arange(mi.UInt32, pixels)

    def step(k: Any, total: Any, sampler: Any) -> tuple[Any, Any, Any]:
        at = [mi.Float((first + k * stride) >> 8) * 2.0**-24 for first, stride in zip(starts, STEPS, strict=True)]
        ray, seen = rays(tools, view, pixel, mi.Point2f(at[0], at[1]), at[2], mi.Point2f(at[3], at[4]))
        return k + 1, total + _radiance(tools, traced, path, sampler, ray, seen, back), sampler

    first = mi.UInt32(0), dr.zeros(mi.Spectrum, pixels), sampler
    _, total, _ = dr.while_loop(first, lambda k, *_: k < samples, step, label="samples of a pixel")
    return total / samples


def _radiance(tools: Tools, traced: Traceable, path: Any, sampler: Any, ray: Any, seen: Any, back: float) -> Any:
    """Return what rays carry, in units of white."""
    mi, dr = tools
    total, hit = mi.Spectrum(0), None
    if traced.is_lit:
        total, hit, _ = path.sample(traced.scene, sampler, ray, active=seen)
    if traced.fill:
        surface = traced.scene.ray_intersect(ray, seen)
        total = total + _fill(tools, traced.fill, surface, surface.bsdf(ray))
        hit = surface.is_valid() if hit is None else hit | surface.is_valid()
    return dr.select(hit, total, back)


def _fill(tools: Tools, lights: tuple[Light, ...], surface: Any, bsdf: Any) -> Any:
    """Return the radiance of surfaces in light that nothing stops: the multipliers of `peaksim.scene.Light`."""
    mi, dr = tools
    normal = dr.select(surface.wi.z < 0, -surface.n, surface.n)
    multiplier = mi.Float(0)
    for light in lights:
        if light.kind == "ambient":
            multiplier += light.intensity
        else:
            away = mi.Vector3f(light.position_m) - surface.p if light.kind == "point" else -mi.Vector3f(light.direction)
            distance = dr.norm(away)
            cosine = dr.maximum(dr.dot(normal, away) / distance, 0)
            fall = (light.reference_m / distance) ** 2 if light.kind == "point" else 1.0
            multiplier += light.intensity * cosine * fall
    return dr.select(surface.is_valid(), bsdf.eval_diffuse_reflectance(surface, surface.is_valid()) * multiplier, 0)
