"""What a shape is: a surface in space or a curve in the plane, and what both can be asked."""
