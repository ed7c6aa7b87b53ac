"""Proofs of workspaces: `prove`, and `load_proof`, which checks a certificate."""

from cinegen.proof.checker import CertificateError, check
from cinegen.proof.exported_equations import ProofError
from cinegen.proof.proof import prove
from cinegen.proof.result import Proof, load_proof

__all__ = ["CertificateError", "Proof", "ProofError", "check", "load_proof", "prove"]
