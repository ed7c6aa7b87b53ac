"""`python -m raff2urdf.urdf2raff`."""

import sys

from raff2urdf.urdf2raff.cli import main

sys.exit(main())
