"""What is measured, on which surfaces, and how."""
