"""What is said without an exception."""


class Doubt(UserWarning):
    """A run finished, but left inputs out, or its results as a whole are in doubt: the command line ends with exit code 3."""
