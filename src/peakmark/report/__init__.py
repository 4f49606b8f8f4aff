"""Results for people: figures, overlays, films, pages, and the folders that hold them."""
