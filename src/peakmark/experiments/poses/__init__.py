"""How far poses are from the truth, and whether their covariance says so."""
