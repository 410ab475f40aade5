"""The two exceptions that a user of the package is meant to meet."""


class InputError(ValueError):
    """Something the user supplied cannot be used; the message says what arrived and what to do.

    The command line prints the message and exits with code 2; the viewer shows it in the window.
    """


class Cancelled(Exception):
    """Raised inside a long computation that nobody waits for any more, see ``Progress.check``."""
