"""What comes in: a surface, checked, cleaned and indexed."""
