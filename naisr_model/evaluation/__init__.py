"""How good an atlas is: distances between shapes, and the tables that report them."""
