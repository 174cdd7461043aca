"""What the two MJX engines share, and the engine on MJX's JAX implementation."""

from ig2mj.process.public_names import offer_modules

offer_modules(__name__)
