"""Looking at worlds: images without a display, videos, and MuJoCo's window with overlays."""

from ig2mj.process.public_names import offer_modules
from ig2mj.viewer.offscreen import FreeView, render

__all__ = ["FreeView", "render"]

offer_modules(__name__)
