"""What was measured, and the questions asked of it."""
