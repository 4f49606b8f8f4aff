"""A page on which trajectories are rotated and zoomed in space; it holds Plotly's script, and needs no network."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.extras import needs_extra

COLOURS = ("#2a9d3a", "#1f77d4", "#e07b00", "#8e5bd0")
"""Of trajectories, in their order; they stand out from white and from nearly black."""

_MARKERS, _LINK = "#888888", 1
"""Colour of printed markers; where a point's custom data has its link."""

_LONGEST = 1.3
"""Length of the longest axis, in Plotly's units."""

_SCRIPT = """
const plot = document.getElementById("{plot_id}");
const dark = window.matchMedia("(prefers-color-scheme: dark)");
function paint() {
  const ink = dark.matches ? "#d9dfe7" : "#1f2328", grid = dark.matches ? "#30363d" : "#d0d7de";
  const axis = name => ({["scene." + name + ".color"]: ink, ["scene." + name + ".gridcolor"]: grid});
  Plotly.relayout(plot, {"font.color": ink, ...axis("xaxis"), ...axis("yaxis"), ...axis("zaxis")});
}
dark.addEventListener("change", paint);
paint();
plot.on("plotly_click", event => {
  const link = (event.points[0].customdata || [])[1];
  if (link) window.open(link, "_blank");
});
"""


@dataclass(frozen=True)
class Line:
    """A trajectory of camera positions."""

    name: str
    positions_m: NDArray[np.float64]
    """(n, 3) world; nan where it is not known, which leaves a gap."""
    labels: Sequence[str]
    """n lines of words on the points."""


def has_trajectory_view() -> bool:
    """Return whether Plotly, of the extra `view`, is there."""
    return find_spec("plotly") is not None


def positions_of(poses: Sequence[NDArray[np.float64] | None]) -> NDArray[np.float64]:
    """Return the (n, 3) positions of (4, 4) poses, nan where one is not known."""
    return np.array([[np.nan] * 3 if pose is None else pose[:3, 3] for pose in poses]).reshape(-1, 3)


@needs_extra
def write_trajectory_view(
    path: Path, title: str, lead: str, lines: Sequence[Line], markers_m: NDArray[np.float64], links: Sequence[str] = ()
) -> None:
    """Write the page: trajectories, (m, 3) markers that were seen, and a link a point that a click follows.

    It is about 5 MB, nearly all of it Plotly's script.
    """
    from jinja2 import Environment, PackageLoader
    from plotly import graph_objects as go

    shown_m = np.concatenate([markers_m, *(line.positions_m for line in lines)])
    traces = [_markers(markers_m), *(_line(k, line, links) for k, line in enumerate(lines))]
    figure = go.Figure(traces, _layout(shown_m))
    html = figure.to_html(full_html=False, include_plotlyjs=True, post_script=_SCRIPT, config=_config(), div_id="view")
    environment = Environment(loader=PackageLoader("peakmark.report"), autoescape=True)
    page = environment.get_template("trajectory.html").render(title=title, lead=lead, figure=html)
    path.write_text(page, encoding="utf-8")


def _line(number: int, line: Line, links: Sequence[str]) -> Any:
    from plotly import graph_objects as go

    x, y, z = line.positions_m.T
    colour = COLOURS[number % len(COLOURS)]
    rows = [[label, link] for label, link in zip(line.labels, links or [""] * len(line.labels), strict=True)]
    return go.Scatter3d(
        x=x.tolist(),
        y=y.tolist(),
        z=z.tolist(),
        name=line.name,
        mode="lines+markers",
        line={"color": colour, "width": 4},
        marker={"color": colour, "size": 2.5},
        customdata=rows,
        hovertemplate="%{customdata[0]}<extra>" + line.name + "</extra>",
    )


def _markers(markers_m: NDArray[np.float64]) -> Any:
    from plotly import graph_objects as go

    x, y, z = markers_m.T
    dots = {"color": _MARKERS, "size": 3, "symbol": "square"}
    return go.Scatter3d(
        x=x.tolist(),
        y=y.tolist(),
        z=z.tolist(),
        name="markers that were seen",
        mode="markers",
        marker=dots,
        hoverinfo="skip",
    )


def _layout(shown_m: NDArray[np.float64]) -> Mapping[str, Any]:
    """Return a layout in which all axes have one scale and the longest just fits the view."""
    spans = np.maximum(np.nanmax(shown_m, axis=0) - np.nanmin(shown_m, axis=0), 1e-3)
    ratios = dict(zip("xyz", (_LONGEST * np.maximum(spans / spans.max(), 0.02)).tolist(), strict=True))
    axes = {f"{name}axis": {"title": {"text": f"{name} (m)"}, "showbackground": False} for name in "xyz"}
    return {
        "scene": {"aspectmode": "manual", "aspectratio": ratios, **axes},
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "top", "x": 0.0},
    }


def _config() -> Mapping[str, Any]:
    return {"responsive": True, "displaylogo": False}
