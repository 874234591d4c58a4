"""`python -m jaxenstein`: the same as the command `jaxenstein`."""

import sys

from .cli import main

if __name__ == "__main__":
    sys.exit(main())
