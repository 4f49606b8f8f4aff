"""Kernel: the mean of a face over the pieces of pixels that `peaksim.area.cut` lists."""

from peaksim.area.cut import COLUMN, FACE, ROW, SIZE
from peaksim.area.faces import CONTRAST, EXTENT_P, LEVEL, PLANE, START, STRIDE
from peaksim.area.polygon import area_of
from peaksim.area.texture import POINT, edge_integral, edge_steps, point_mean
from peaksim.kernel import kernel, part


@part
def polygon_mean(texels, start, stride, contrast, polygons, k, n, u, v, reach):
    """Return the mean of a texture over the n vertices of polygon k, texels, with middle (u, v) and longest side."""
    area = area_of(polygons, k, n)
    if reach < POINT or abs(area) < 1e-6 * reach * reach:
        return point_mean(texels, start, stride, u, v)
    total = 0.0
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        u0, v0, u1, v1 = polygons[k, i, 0], polygons[k, i, 1], polygons[k, j, 0], polygons[k, j, 1]
        steps = edge_steps(u1 - u0, v1 - v0, abs(area), contrast)
        total += edge_integral(texels, start, stride, u0, v0, u1, v1, steps)
    return total / area


@kernel
def add_pieces(printed, faces, texels, n, polygons, pieces, shares, light, out):
    """Add the first n pieces of a band to `out` (h, w, channels): share × light × mean of the face; see `cut_mixed`.

    `light` (n, channels) is the multiplier of each piece.
    """
    for k in range(n):
        y, x, face, size = pieces[k, ROW], pieces[k, COLUMN], pieces[k, FACE], pieces[k, SIZE]
        textured = printed[y if printed.shape[0] > 1 else 0, face]
        u = v = reach = value = 0.0
        for i in range(size):
            for axis in range(2):
                inside = min(max(polygons[k, i, axis], 0.0), faces[face, EXTENT_P + axis])
                reach = max(reach, abs(inside - polygons[k, 0, axis]))
                polygons[k, i, axis] = inside
            u += polygons[k, i, 0] / size
            v += polygons[k, i, 1] / size
        for channel in range(out.shape[2]):
            if not textured:
                value = faces[face, LEVEL + channel]
            elif channel == 0 or faces[face, PLANE] > 0.0:
                start = int(faces[face, START] + channel * faces[face, PLANE])
                stride = int(faces[face, STRIDE])
                value = polygon_mean(texels, start, stride, faces[face, CONTRAST], polygons, k, size, u, v, reach)
            out[y, x, channel] += shares[k] * light[k, channel] * value
