"""Maps that begin: other boundaries, Tutte embeddings, and what is corrected of harmonic maps."""
