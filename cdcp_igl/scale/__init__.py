"""Many surfaces, or one that is larger than memory. No map is made here."""
