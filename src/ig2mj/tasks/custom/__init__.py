"""Tasks of a user's own file: their classes and functions, what they say in code, and what determines them.

A file of tasks is a program: importing it runs it, with the rights of the process. ig2mj imports a file only where its
user names it (`my_tasks.py:MugToTable`), and never because a recording or a policy does.
"""

from ig2mj.process.public_names import offer_modules

offer_modules(__name__)
