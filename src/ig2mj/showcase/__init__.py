from ig2mj.process.public_names import offer_modules

offer_modules(__name__)
