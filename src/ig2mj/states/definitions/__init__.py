"""The extended states, one file each."""
