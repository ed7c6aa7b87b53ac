"""Graphics of robots: graphic files, and a drawing for nodes without any."""

import logging

for _library in ("ezdxf", "trimesh"):  # what they log about a damaged file is in the error, too
    logging.getLogger(_library).addHandler(logging.NullHandler())
