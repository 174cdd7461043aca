"""`python -m ig2mj` is the command `ig2mj`."""

from ig2mj.cli import main

if __name__ == "__main__":
    main()
