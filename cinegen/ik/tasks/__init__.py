"""Tasks: frames on nodes, other kinds, and tasks of other packages."""
