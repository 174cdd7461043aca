"""The dataset's files in iGibson's layout, and the folder of converted homes."""
