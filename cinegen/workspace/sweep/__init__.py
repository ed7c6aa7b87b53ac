"""Design sweeps: a parameter of a robot varies, and each variant gets a map and a row in a table."""

from cinegen.workspace.sweep.box import Box
from cinegen.workspace.sweep.parameter import Parameter
from cinegen.workspace.sweep.sweep import sweep
from cinegen.workspace.sweep.table import Row, Table
from cinegen.workspace.sweep.variant import Variant, variants
from cinegen.workspace.sweep.variation import Variation

__all__ = ["Box", "Parameter", "Row", "Table", "Variant", "Variation", "sweep", "variants"]
