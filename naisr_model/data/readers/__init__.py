"""Readers of mesh formats, a module each: ``read(name, content)`` gives :class:`~.parts.Parts`."""
