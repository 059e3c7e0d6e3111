"""`python -m octoctrl`: the command line."""

import sys

from .cli.application import main

sys.exit(main())
