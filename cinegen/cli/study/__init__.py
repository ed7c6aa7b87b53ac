"""Commands that study robots: assembly modes, singularities, forces, maps, proofs."""
