"""Kernels: candidate faces from an image of the number of the nearest face at samples of each pixel.

A tile's candidates are the faces shown in it and right beside it; where they are too many, each of its pixels has
candidates of its own. `owner` and `cut` then tell exactly what fills a pixel. A pixel with too many
candidates is CROWDED: the mean of SAMPLES × SAMPLES parts, each filled by the face that is shown at its middle.
"""

import numpy as np

from peaksim.area.cut import COLUMN, FACE, ROW, SIZE
from peaksim.area.faces import DEPTH
from peaksim.kernel import kernel, part

SAMPLES = 4
"""Samples a pixel along each axis."""
MOST_FACES = 24
"""Most candidates; the time to cut a pixel grows with their square."""
CROWDED = -3
"""Owner of a pixel with more candidates."""
NUMBER_BITS = 0xFFFFFF
"""Bits of a sample that hold the number of the face + 1, 0 for none."""


@part
def number_at(numbers, row, column):
    """Return the face that a sample shows, −1 for none; beyond the border, the nearest sample."""
    i = min(max(row, 0), numbers.shape[0] - 1)
    j = min(max(column, 0), numbers.shape[1] - 1)
    return int(numbers[i, j] & NUMBER_BITS) - 1


@part
def add_face(faces, n, face):
    """Add a face to the first n in a list, unless it is among them or the list is full; return their number."""
    for k in range(n):
        if faces[k] == face:
            return n
    if n < faces.size:
        faces[n] = face
        n += 1
    return n


@part
def list_between(numbers, left, top, right, bottom, touching, groups, faces):
    """List the faces of the samples that touch a rectangle, and those that touch them; return their number."""
    n, last = 0, np.uint32(0)
    rows, columns = numbers.shape
    first, end = max(int(np.floor(left - 0.5)), 0), min(int(np.floor(right + 0.5)) + 1, columns)
    for row in range(max(int(np.floor(top - 0.5)), 0), min(int(np.floor(bottom + 0.5)) + 1, rows)):
        for column in range(first, end):
            if numbers[row, column] != last:
                last = numbers[row, column]
                if last & NUMBER_BITS:
                    n = add_face(faces, n, int(last & NUMBER_BITS) - 1)
    shown = n
    for other in touching:
        for k in range(shown):
            if groups[other] == groups[faces[k]]:
                n = add_face(faces, n, other)
    return n


@kernel
def list_in_tiles(numbers, groups, touching, n_touching, boxes, found, counts):
    """Write the candidates of each tile of a band.

    Parameters
    ----------
    numbers
        (r, c) uint32 image of numbers.
    groups
        (f,) faces of one number ≥ 0 lie on each other, so that the image may show one instead of another.
    touching, n_touching
        (t, n) and (t,) faces that have a group and may be visible in each tile, and their number.
    boxes
        (t, 6) least and largest (column, row, 1) of each tile in the image of numbers.
    found, counts
        (t, MOST_FACES + 1) and (t,) written: candidates, and their number; MOST_FACES + 1 if there are more.
    """
    for tile in range(len(boxes)):
        left, top, right, bottom = boxes[tile, 0], boxes[tile, 1], boxes[tile, 3], boxes[tile, 4]
        others = touching[tile, : n_touching[tile]]
        counts[tile] = list_between(numbers, left, top, right, bottom, others, groups, found[tile])


@kernel
def list_in_pixels(numbers, groups, touching, n_touching, positions, tile, full, found, counts, alone, cells):
    """Write the candidates of each pixel of those tiles that have too many.

    Parameters
    ----------
    numbers, groups, touching, n_touching
        As in `list_in_tiles`.
    positions
        (h + 1, w + 1, 3) (column, row, 1) of the pixel corners in the image of numbers.
    tile
        Width of a tile, px.
    full
        (t,) whether a tile has too many candidates.
    found, counts
        As in `list_in_tiles`, with a row more for each pixel of such tiles, which is written.
    alone
        (t + p,) owner of all pixels of a cell; written: CROWDED for pixels with too many candidates.
    cells
        (h, w) tile of each pixel; written: row of `found` of pixels of full tiles.
    """
    cell = len(touching)
    for y in range(cells.shape[0]):
        for x in range(cells.shape[1]):
            if full[x // tile]:
                left = top = np.inf
                right = bottom = -np.inf
                for corner in range(4):
                    i, j = y + corner // 2, x + corner % 2
                    left, right = min(left, positions[i, j, 0]), max(right, positions[i, j, 0])
                    top, bottom = min(top, positions[i, j, 1]), max(bottom, positions[i, j, 1])
                others = touching[x // tile, : n_touching[x // tile]]
                counts[cell] = list_between(numbers, left, top, right, bottom, others, groups, found[cell])
                if counts[cell] > MOST_FACES:
                    alone[cell] = CROWDED
                cells[y, x] = cell
                cell += 1


@part
def keep_part(sides, face, rays, y, x, left, top, polygon):
    """Write the part of a pixel that begins at (left, top), both 0…1, in a face's coordinates."""
    for corner in range(4):
        s, t = left + (corner + 1) // 2 % 2 / SAMPLES, top + corner // 2 / SAMPLES
        p = q = w = 0.0
        for axis in range(3):
            above = (1.0 - s) * rays[y, x, axis] + s * rays[y, x + 1, axis]
            below = (1.0 - s) * rays[y + 1, x, axis] + s * rays[y + 1, x + 1, axis]
            ray = (1.0 - t) * above + t * below
            p += sides[0, face, 0, axis] * ray
            q += sides[0, face, 1, axis] * ray
            w += sides[0, face, DEPTH, axis] * ray
        polygon[corner, 0] = p / max(w, 1e-12)
        polygon[corner, 1] = q / max(w, 1e-12)


@kernel
def cut_crowded(rays, sides, numbers, positions, pixels, background, polygons, pieces, shares, out):
    """List the parts of CROWDED pixels, and add background where none is shown; return their number.

    Parameters
    ----------
    rays, sides, background, polygons, pieces, shares, out
        As in `cut_mixed`, with room for n · SAMPLES² pieces.
    numbers, positions
        As in `list_in_pixels`.
    pixels
        (n, 2) row and column.
    """
    n_pieces = 0
    for k in range(len(pixels)):
        y, x = pixels[k]
        for cell in range(SAMPLES * SAMPLES):
            left, top = cell % SAMPLES / SAMPLES, cell // SAMPLES / SAMPLES
            s, t = left + 0.5 / SAMPLES, top + 0.5 / SAMPLES
            above = (1.0 - s) * positions[y, x] + s * positions[y, x + 1]
            middle = (1.0 - t) * above + t * ((1.0 - s) * positions[y + 1, x] + s * positions[y + 1, x + 1])
            face = number_at(numbers, int(np.floor(middle[1])), int(np.floor(middle[0])))
            if face >= 0:
                keep_part(sides, face, rays, y, x, left, top, polygons[n_pieces])
                shares[n_pieces] = 1.0 / (SAMPLES * SAMPLES)
                pieces[n_pieces, ROW], pieces[n_pieces, COLUMN] = y, x
                pieces[n_pieces, FACE], pieces[n_pieces, SIZE] = face, 4
                n_pieces += 1
            else:
                for channel in range(out.shape[2]):
                    out[y, x, channel] += background / (SAMPLES * SAMPLES)
    return n_pieces
