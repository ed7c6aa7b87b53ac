"""Many configurations at once, as maps need them: where a node is, how motors move it, and how well."""

from cinegen.solve.sample.evaluate import Evaluations, Sampler, evaluate

__all__ = ["Evaluations", "Sampler", "evaluate"]
