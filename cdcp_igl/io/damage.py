"""What readers raise on files that they cannot read."""


class Damage(Exception):
    """A file that is not what its name says, in words for whoever made the file."""
