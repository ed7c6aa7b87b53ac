"""`python -m raff2urdf`."""

import sys

from raff2urdf.cli import main

sys.exit(main())
