"""What several commands share: parsing, printing, checks of files, scenes that are set up."""

from ig2mj.process.public_names import offer_modules

offer_modules(__name__)
