"""Kernel: runs of pixels that one face fills, each the mean of the texture over the pixel's footprint.

Neighbouring pixels share the line integrals of their edges, so a pixel costs two edges instead of four.
"""

from peaksim.area.faces import CONTRAST, DEPTH, LEVEL, PLANE, START, STRIDE
from peaksim.area.owner import NOTHING
from peaksim.area.texture import POINT, edge_integral, edge_steps, point_mean
from peaksim.kernel import kernel, part

CHUNK = 16
"""Most pixels that share one choice of steps."""


@part
def footprints(sides, pose, face, rays, y, x, n, corners):
    """Write texture coordinates of the corners above (0) and below (1) n pixels to `corners` (2, 2, n + 1)."""
    for row in range(2):
        for k in range(n + 1):
            u = v = w = 0.0
            for axis in range(3):
                ray = rays[y + row, x + k, axis]
                u += sides[pose, face, 0, axis] * ray
                v += sides[pose, face, 1, axis] * ray
                w += sides[pose, face, DEPTH, axis] * ray
            corners[row, 0, k] = u / w
            corners[row, 1, k] = v / w


@part
def run_steps(corners, n, contrast):
    """Return steps of horizontal and of vertical edges, and the longest side in texels, over a run of n pixels."""
    across, down, reach = 1, 1, 0.0
    for j in range(3):
        k = (n - 1) * j // 2
        u, v = corners[1, 0, k], corners[1, 1, k]
        du, dv, eu, ev = corners[1, 0, k + 1] - u, corners[1, 1, k + 1] - v, u - corners[0, 0, k], v - corners[0, 1, k]
        area = abs(du * ev - dv * eu)
        across = max(across, edge_steps(du, dv, area, contrast))
        down = max(down, edge_steps(eu, ev, area, contrast))
        reach = max(reach, max(max(abs(du), abs(dv)), max(abs(eu), abs(ev))))
    return across, down, reach


@part
def integrate_run(texels, start, stride, corners, n, across, down, reach, known, shared, channel, out, y, x0):
    """Write n means from x0 on; `shared` (channels, w) holds the upper edges if known, and receives the lower ones."""
    before = 0.0
    for k in range(n + 1):
        u0, v0, u3, v3 = corners[0, 0, k], corners[0, 1, k], corners[1, 0, k], corners[1, 1, k]
        after = edge_integral(texels, start, stride, u0, v0, u3, v3, down)
        if k > 0:
            x = x0 + k - 1
            ua, va, ub, vb = corners[0, 0, k - 1], corners[0, 1, k - 1], corners[1, 0, k - 1], corners[1, 1, k - 1]
            top = shared[channel, x] if known else edge_integral(texels, start, stride, ua, va, u0, v0, across)
            bottom = edge_integral(texels, start, stride, ub, vb, u3, v3, across)
            area = 0.5 * ((u3 - ua) * (vb - v0) - (v3 - va) * (ub - u0))
            shared[channel, x] = bottom
            out[y, x, channel] = (top + after - bottom - before) / area
            if reach < POINT:
                out[y, x, channel] = point_mean(texels, start, stride, 0.5 * (ua + u3), 0.5 * (va + v3))
        before = after


@part
def fill_run(faces, face, texels, corners, n, known, shared, out, y, x0):
    """Write a textured run of n pixels from x0 on; `known` and `shared` as in `integrate_run`."""
    across, down, reach = run_steps(corners, n, faces[face, CONTRAST])
    stride = int(faces[face, STRIDE])
    for channel in range(out.shape[2]):
        if channel == 0 or faces[face, PLANE] > 0.0:
            start = int(faces[face, START] + channel * faces[face, PLANE])
            integrate_run(texels, start, stride, corners, n, across, down, reach, known, shared, channel, out, y, x0)
        else:
            out[y, x0 : x0 + n, channel] = out[y, x0 : x0 + n, 0]


@kernel
def fill_owned(rays, sides, printed, faces, texels, owners, background, corners, shared, previous, out):
    """Write all pixels of a band that have an owner; the others become 0.

    Parameters
    ----------
    rays
        (h + 1, w + 1, 3) directions of the pixel corners.
    sides, printed, faces, texels
        As in `FaceViews` and `Faces`.
    owners
        (h, w) face, NOTHING or MIXED.
    background
        Level of NOTHING.
    corners, shared, previous
        Memory: (2, 2, CHUNK + 1), (channels, w), and (w,) initially −1: whose lower edges `shared` holds.
    out
        (h, w, channels) written.
    """
    still = sides.shape[0] == 1
    for y in range(owners.shape[0]):
        pose, x = 0 if still else y, 0
        while x < owners.shape[1]:
            owner = owners[y, x]
            known = still and previous[x] == owner
            end, most = x + 1, min(owners.shape[1], x + corners.shape[2] - 1)
            while end < most and owners[y, end] == owner and (still and previous[end] == owner) == known:
                end += 1
            if owner >= 0 and printed[pose, owner]:
                footprints(sides, pose, owner, rays, y, x, end - x, corners)
                fill_run(faces, owner, texels, corners, end - x, known, shared, out, y, x)
                previous[x:end] = owner
            else:
                for channel in range(out.shape[2]):
                    empty = background if owner == NOTHING else 0.0
                    out[y, x:end, channel] = faces[owner, LEVEL + channel] if owner >= 0 else empty
                previous[x:end] = -1
            x = end
