"""What steps in where Algorithm 1 fails, and how far a map is from conformal."""
