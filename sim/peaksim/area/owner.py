"""Which faces may be visible in each tile, and which face fills a pixel alone.

Tiles first: a face that cannot touch a tile, or lies behind one that covers it, is dropped by interval arithmetic over
the tile's viewing directions. Then pixels: a face that covers all four corners and is in front of every other face
there owns the pixel.
"""

from peaksim.native import function

TILE = 16
"""Width of a tile, px."""
NOTHING, MIXED = -1, -2
"""Owners of a pixel that shows only background, and of one that shows several faces or a face's edge."""
keep_faces = function(
    "status keep_faces(const f8[faces,5,3] low, const f8[faces,5,3] high, const f8[tiles,6] boxes, "
    "i8[tiles,room] found, i8[tiles] counts, i8[tiles] alone)"
)
"""Keep those faces of each box of directions that may be visible in it.

low, high
    Least and largest sides of all faces over the poses, see `FaceViews`.
boxes
    Least and largest directions of tiles.
found, counts
    Faces of each box and their number; those that are hidden or outside are removed.
alone
    Written: the face that covers a box and hides all others, NOTHING, or MIXED where each pixel must be examined.
"""
find_faces = function(
    "status find_faces(const f8[faces,5,3] low, const f8[faces,5,3] high, const f8[tiles,6] boxes, "
    "i8[n] candidates, i8[1] left, i8[tiles,room] found, i8[tiles] counts, i8[tiles] alone)"
)
"""Write which of the same candidates may be visible in each of one or more boxes; see `keep_faces`.

candidates, left
    The first ones are replaced by those that may be visible in all boxes together; written: their number. If it
    exceeds the room, nothing else is written.
"""
find_owners = function(
    "status find_owners(const f8[rows,columns,3] rays, const f8[poses,faces,5,3] sides, const i8[height,width] cells, "
    "const i8[lists,room] found, const i8[lists] counts, const i8[lists] alone, i8[height,width] owners)"
)
"""Write the owner of each pixel of a band.

rays
    (h + 1, w + 1, 3) directions of the pixel corners.
sides
    From one pose, or one for each row.
cells
    Row of `found` that lists the faces a pixel may show.
found, counts, alone
    From `keep_faces`, for each cell.
owners
    Written.
"""
