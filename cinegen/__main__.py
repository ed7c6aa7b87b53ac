"""`python -m cinegen`."""

import sys

from cinegen.cli import main

sys.exit(main())
