"""Tasks: what is to be done in a home, and whether it is done."""

from ig2mj.process.public_names import offer_modules

offer_modules(__name__)
