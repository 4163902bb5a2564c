"""What steps in where Algorithm 1 fails: other boundaries, repair, what doubles cannot hold."""
