"""What comes in: a surface, checked, mended and indexed."""
