"""Work on several machines: processes that train together, and pieces of work that any of them can do."""

from ig2mj.process.public_names import offer_modules

offer_modules(__name__)
