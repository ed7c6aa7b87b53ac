"""`python -m cinegen.cli`."""

import sys

from cinegen.cli import main

sys.exit(main())
