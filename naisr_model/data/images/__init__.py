"""Three-dimensional images from files: NIfTI, Analyze, NRRD and MetaImage, told apart by what is in them."""
