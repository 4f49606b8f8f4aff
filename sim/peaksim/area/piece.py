"""The mean of a face over the pieces of pixels that `peaksim.area.cut` lists."""

from peaksim.native import function

add_pieces = function(
    "void add_pieces(const b1[poses,faces] printed, const f8[faces,28] table, const f8[n_texels] texels, i8 count, "
    "f8[n,24,2] polygons, const i8[n,4] pieces, const f8[n] shares, const f8[lit,channels] light, "
    "f4[height,width,channels] out)"
)
"""Add the first `count` pieces of a band to `out`: share × light × mean of the face.

printed, table, texels
    As in `FaceViews` and `Faces`.
polygons, pieces, shares
    As in `cut.Lists`; polygons are brought into their faces.
light
    Multiplier of each piece.
"""
