"""Lowering the distortion of a map that is valid, onto whatever target."""
