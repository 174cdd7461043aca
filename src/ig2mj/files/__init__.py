"""Reads untrusted files: bounded before anything is allocated, and one typed error for all that is wrong.

`limits` says how much is read, `content` reads bytes, text and JSON, `npz` and `hdf5` read arrays, `inside` keeps paths
below a folder, and `heartbeat` says whether the maker of a temporary folder still runs. Every reader of the
project is built on these; `docs/guide/untrusted_input.md` says what they promise.
"""
