"""Checks of a converted scene, and the report that shows them."""
