"""What people look at: figures, overlays, films, pages, and the folders that hold them."""
