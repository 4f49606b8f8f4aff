"""A robot that drives along floor markers by its camera alone."""
