"""The sensors, a file for each subject."""
