"""The native engine: C MuJoCo with sleeping, one world or many on a thread pool."""

from ig2mj.process.public_names import offer_modules

offer_modules(__name__)
