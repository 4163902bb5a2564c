"""What is said of a map: is it a bijection, how far from conformal, and why."""
