"""Checks of a converted model: measured on what was written, listed object by object."""
