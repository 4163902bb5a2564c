"""Targets, energies, and one descent that lowers an energy on a target and flips no face."""
