"""What people call: a surface in, a map out, an idea of the image a module."""
