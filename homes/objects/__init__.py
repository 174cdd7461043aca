"""Objects: the catalogue, one file per family of categories, and what a model consists of."""
