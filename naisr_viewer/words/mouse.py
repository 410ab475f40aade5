"""What the mouse and the keys do to the shapes; what menus offer tells itself."""

from __future__ import annotations

SHAPES = (
    ("Drag", "turn the shapes; move curves in the plane"),
    ("Drag with Shift, or with the middle button", "move them"),
    ("Wheel", "nearer to what is under the pointer, or farther"),
    ("Double-click", "bring a point to the middle; in the matrix, show that cell large"),
    ("Click", "pin a place; in the matrix, take the values of that cell"),
    ("Rest on a surface", "tell the place and the number there"),
    ("Arrows", "turn the shapes, or move curves, once the Tab key has come to them"),
    ("Shift+Arrows", "move them"),
    ("+ and −", "nearer, or farther"),
)
"""What is done, and what follows."""

BESIDE = (
    ("Drag an end of a colour bar", "move the end of the scale"),
    ("Double-click on a colour bar", "fit the scale to what is shown"),
    ("Enter, Esc in a box", "take what was typed, or restore what was there"),
    ("Arrows on a slider", "a step; Page Up and Page Down ten"),
    ("Drop a file", "open an atlas, a scan or a session"),
)
"""The same of what stands beside the shapes."""
