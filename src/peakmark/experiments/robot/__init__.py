"""A robot that drives along floor markers by what its camera sees of them."""
