"""Many scans at once: a table of them read, fitted and measured, with one table of what was found."""
