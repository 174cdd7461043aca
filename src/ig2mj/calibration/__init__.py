"""How large a batched engine's buffers must be for a scene, and the pushing hand that disturbs it to find out."""

from ig2mj.process.public_names import offer_modules

offer_modules(__name__)
