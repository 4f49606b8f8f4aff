"""peaksim: scenes of textured quads, rendered with pixels and truth that can be trusted."""
