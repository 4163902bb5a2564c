"""Results, and what is done with a map: apply, invert, remesh, register."""
