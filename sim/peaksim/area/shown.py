"""Candidate faces from an image of the number of the nearest face at samples of each pixel.

A tile's candidates are the faces shown in it and right beside it; where they are too many, each of its pixels has
candidates of its own. `owner` and `cut` then tell exactly what fills a pixel. A pixel with too many
candidates is CROWDED: the mean of SAMPLES × SAMPLES parts, each filled by the face that is shown at its middle.
"""

from peaksim.native import function

SAMPLES = 4
"""Samples a pixel along each axis."""
MOST_FACES = 24
"""Most candidates; the time to cut a pixel grows with their square."""
CROWDED = -3
"""Owner of a pixel with more candidates."""
NUMBER_BITS = 0xFFFFFF
"""Bits of a sample that hold the number of the face + 1, 0 for none."""


list_in_tiles = function(
    "void list_in_tiles(const u4[rows,columns] numbers, const i8[faces] groups, const i8[tiles,room] touching, "
    "const i8[tiles] n_touching, const f8[tiles,6] boxes, i8[tiles,25] found, i8[tiles] counts)"
)
"""Write the candidates of each tile of a band.

numbers
    Image of numbers.
groups
    Faces of one number ≥ 0 lie on each other, so that the image may show one instead of another.
touching, n_touching
    Faces that have a group and may be visible in each tile, and their number.
boxes
    Least and largest (column, row, 1) of each tile in the image of numbers.
found, counts
    Written: candidates, and their number; MOST_FACES + 1 if there are more.
"""
list_in_pixels = function(
    "void list_in_pixels(const u4[rows,columns] numbers, const i8[faces] groups, const i8[tiles,room] touching, "
    "const i8[tiles] n_touching, const f8[corner_rows,corner_columns,3] positions, "
    "const f8[corner_rows,corner_columns,3] rays, const f8[poses,faces,5,3] sides, i8 tile_width, "
    "const b1[tiles] full, i8[lists,25] found, i8[lists] counts, i8[lists] alone, i8[height,width] cells)"
)
"""Write the candidates of each pixel of those tiles that have too many.

numbers, groups, touching, n_touching
    As in `list_in_tiles`.
positions
    (h + 1, w + 1, 3) (column, row, 1) of the pixel corners in the image of numbers.
rays, sides
    Directions of the pixel corners, and the faces, as in `find_owners`: of the touching ones those are listed that may
    reach into a pixel.
tile_width
    Width of a tile, px.
full
    Whether a tile has too many candidates.
found, counts
    As in `list_in_tiles`, with a row more for each pixel of such tiles, which is written.
alone
    Owner of all pixels of a cell; written: CROWDED for pixels with too many candidates.
cells
    Tile of each pixel; written: row of `found` of pixels of full tiles.
"""
cut_crowded = function(
    "i8 cut_crowded(const f8[corner_rows,corner_columns,3] rays, const f8[poses,faces,5,3] sides, "
    "const u4[rows,columns] numbers, const f8[corner_rows,corner_columns,3] positions, const i8[count,2] pixels, "
    "const f8[height,width,channels] background, f8[n,24,2] polygons, i8[n,4] pieces, f8[n] shares, "
    "f4[height,width,channels] out)"
)
"""List the parts of CROWDED pixels, and add background where none is shown; return their number.

rays, sides, background, polygons, pieces, shares, out
    As in `cut_mixed`, with room for count · SAMPLES² pieces.
numbers, positions
    As in `list_in_pixels`.
pixels
    Row and column.
"""
