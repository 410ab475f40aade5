"""Three-dimensional images from files: NIfTI and NRRD, told apart by what is in them."""
