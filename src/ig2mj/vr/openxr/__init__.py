"""Headsets by OpenXR, through pyopenxr (extra `xr`)."""
