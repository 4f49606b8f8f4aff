#!/usr/bin/env python3
"""Write the images and the truth of a corpus in the form that `score_independent.py` reads.

    corpus_truth.py CORPUS --out DIR

The condition of an image is "warped" where it is a photograph with sheets, else the name of its scene; its version is
the name of its sensor.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from peaksim.camera import Camera
from peaksim.corpus import open_corpus

Row = dict[str, Any]


def marker_row(marker: Row, camera: Camera) -> Row:
    """Return a marker of a record; one of which a corner is outside does not lie wholly inside."""
    points = np.array([[np.nan if value is None else value for value in xy] for xy in marker["points_xy"]])
    return {
        "polarity": "light" if "light" in marker["kind"] else "dark",
        "xy": points[0].tolist(),
        "corners": points[1:].tolist(),
        "side_px": marker["side_px"],
        "tilt_deg": marker["tilt_deg"],
        "visible": marker["visible_fraction"],
        "inside": float(camera.contains(points).all()),
        "bent": marker.get("bend_radius_m"),
        "code": None,
        "part": 0,
        "group": marker["name"],
    }


def main() -> None:
    """Write DIR/images/ and DIR/truth.json."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus")
    parser.add_argument("--out", type=Path, default=Path("out/truth"))
    args = parser.parse_args()
    corpus, rows = open_corpus(args.corpus), []
    (args.out / "images").mkdir(parents=True, exist_ok=True)
    for record in corpus.records():
        image = corpus.picture(record["frame"])
        file = f"images/{record['frame']:08d}.png"
        cv2.imwrite(str(args.out / file), image if image.ndim == 2 else image[:, :, ::-1])
        camera = Camera(**{name: value for name, value in record["camera"].items() if name != "name"})
        markers = [marker_row(marker, camera) for marker in record["markers"] if marker["side_px"] is not None]
        condition = "warped" if record["view"] == "warped" else record["scene"]
        version = record["sensor"]["name"] or "plain"
        rows.append({"file": file, "kind": "frame", "condition": condition, "version": version, "markers": markers})
    (args.out / "truth.json").write_text(json.dumps(rows))


if __name__ == "__main__":
    main()
