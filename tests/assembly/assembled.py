"""What is asked of assembly modes whatever the mechanism, and what random closings find."""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

import cinegen
from cinegen.assembly import AssemblyModes

_SAME = 1e-5


def home(mechanism: cinegen.Mechanism) -> np.ndarray:
    """Its motors' values."""
    return np.array([mechanism.q_home[mechanism.q_index(name)] for name in mechanism.actuated])


def places(mechanism: cinegen.Mechanism, q: np.ndarray, nodes: Sequence[str] | None = None) -> np.ndarray:
    """(n, 4, 4) where nodes are, all unless given."""
    return np.array([mechanism.placement(q, node).homogeneous for node in nodes or mechanism.nodes])


def apart(entry: np.ndarray, others: Sequence[np.ndarray]) -> float:
    """How far it is from the nearest of the others."""
    return min((float(np.abs(entry - other).max()) for other in others), default=np.inf)


def sound(modes: AssemblyModes, nodes: Sequence[str] | None = None, count: int | None = None) -> list[np.ndarray]:
    """Asserts that all modes are closed, with the motors where they were asked to be, and differ. Places of nodes."""
    m = modes.mechanism
    seen = list[np.ndarray]()
    for q in modes:
        assert m.closure(q) <= 1e-12
        assert np.allclose([q[m.q_index(name)] for name in m.actuated], modes.actuated, rtol=0.0, atol=1e-15)
        poses = places(m, q, nodes)
        assert apart(poses, seen) > 1e-7
        seen.append(poses)
    assert count is None or len(modes) == count, modes
    assert len(modes.coincident) == len(modes)
    assert modes.counts.real == sum(modes.coincident)
    return seen


def traced(modes: AssemblyModes) -> None:
    """Asserts that the trace test found nothing missing, and that this is not called a proof."""
    assert modes.trace_test, modes
    assert not modes.complete
    assert "trace test satisfied to" in modes.method
    assert "not excluded" in modes.method


def alike(these: Sequence[np.ndarray], those: Sequence[np.ndarray], tolerance: float = 1e-7) -> None:
    """Asserts that two sets are the same."""
    assert len(these) == len(those)
    for entry in these:
        assert apart(entry, those) < tolerance
    for entry in those:
        assert apart(entry, these) < tolerance


def closings(modes: AssemblyModes, starts: int, seed: int = 0) -> list[np.ndarray]:
    """What Gauss-Newton closes random configurations to, with the motors where the modes have them."""
    m, rng, closed = modes.mechanism, np.random.default_rng(seed), list[np.ndarray]()
    asked = m.configuration(dict(zip(m.actuated, modes.actuated.tolist(), strict=True)))
    for _ in range(starts):
        q = asked.copy()
        for name in (name for name in m.joints if name not in m.actuated):
            k = m.q_index(name)
            q[k] = q[k] + m.length * rng.normal() if m.is_prismatic(name) else rng.uniform(-np.pi, np.pi)
        with suppress(cinegen.ClosureError):
            closed.append(m.close(q, locked=m.actuated))
    return closed


def nothing_beside(modes: AssemblyModes, nodes: Sequence[str], starts: int = 30, seed: int = 0) -> None:
    """Assert that random closings find modes, and none that is not among these."""
    m = modes.mechanism
    known = [places(m, q, nodes) for q in modes]
    closed = closings(modes, starts, seed)
    assert closed, f"none of {starts} random starts was closed: nothing was compared"
    for q in closed:
        assert apart(places(m, q, nodes), known) < _SAME, modes
