"""Design sweeps: a parameter of a robot varies, and each variant gets a map and a row in a table."""

from cinegen.study.maps.sweep.box import Box
from cinegen.study.maps.sweep.parameter import Parameter
from cinegen.study.maps.sweep.sweep import sweep
from cinegen.study.maps.sweep.table import Row, Table
from cinegen.study.maps.sweep.variant import Variant, variants
from cinegen.study.maps.sweep.variation import Variation

__all__ = ["Box", "Parameter", "Row", "Table", "Variant", "Variation", "sweep", "variants"]
