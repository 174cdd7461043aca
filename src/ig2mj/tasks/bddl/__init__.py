"""Activities in BDDL: BEHAVIOR-100 and BEHAVIOR-1K, bound to homes and compiled to goals."""

from ig2mj.process.public_names import offer_modules

offer_modules(__name__)
