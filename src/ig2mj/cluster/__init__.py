"""Work on several processes and machines: teams of processes that train together, and independent jobs."""

from ig2mj.process.public_names import offer_modules

offer_modules(__name__)
