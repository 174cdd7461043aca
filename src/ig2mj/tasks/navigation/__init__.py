"""Navigation tasks: going to a point, among loose objects and other robots; reaching; closing furniture."""

from ig2mj.process.public_names import offer_modules

offer_modules(__name__)
