"""A home of one's own from a short TOML.

`description` is the file, `own_plan` makes rooms, doors and windows of it, `own_furniture` says what stands where, and
`own_home` writes all of it as a scene of a dataset.
"""
