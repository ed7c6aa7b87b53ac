"""Design sweeps: a parameter of a robot varies, and each variant gets a map and a result."""

from cinegen.workspace.sweep.box import WantedBox
from cinegen.workspace.sweep.result import SweepResult, VariantResult
from cinegen.workspace.sweep.run import sweep
from cinegen.workspace.sweep.variants import SweptParameter, Variant, Variation, variants

__all__ = ["SweepResult", "SweptParameter", "Variant", "VariantResult", "Variation", "WantedBox", "sweep", "variants"]
