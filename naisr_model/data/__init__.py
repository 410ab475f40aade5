"""From a folder of meshes and a table of covariates to samples that a network can be trained on."""
