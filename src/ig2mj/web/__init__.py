"""Pages for browsers: the viewer of `ig2mj web`, and the server with its gate, which other pages use too."""
