"""The Laplacian, its factorization, and the order of elimination."""
