"""Pages for browsers: the viewer of `ig2mj web`, and the server with its gate, which other pages use too."""

from ig2mj.process.public_names import offer_modules

offer_modules(__name__)
