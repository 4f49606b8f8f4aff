"""peakmark: maximum detector response markers for SIFT and SURF (Schweiger et al., 2009)."""
