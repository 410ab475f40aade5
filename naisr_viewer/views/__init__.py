"""Widgets, one a file. A setter never changes the state; what the user does leaves as a signal."""
