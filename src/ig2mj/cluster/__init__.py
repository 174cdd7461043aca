"""Work on several machines: processes that train together, and pieces of work that any of them can do."""
