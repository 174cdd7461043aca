"""The engine on MJX-Warp: thousands of worlds on a GPU; its buffers, and the patches of MuJoCo Warp."""

from ig2mj.process.public_names import offer_modules

offer_modules(__name__)
