"""Self-signed certificates, with which a page is served by HTTPS."""

from __future__ import annotations

import datetime
import ipaddress
import os
import ssl
import tempfile
from typing import NamedTuple

from raff2urdf.command.extras import needs

_BACK = datetime.timedelta(hours=1)  # clocks of headsets may be late
_VALID = datetime.timedelta(days=30)


class PageCertificate(NamedTuple):
    """A certificate and its key, of one session.

    Attributes:
        context: for a server.
        fingerprint: SHA-256 of the certificate, as browsers show it.
    """

    context: ssl.SSLContext
    fingerprint: str


def self_signed(host: str) -> PageCertificate:
    """Make a certificate of a host. Its key stays in memory, but for a moment in a file that only its owner can read.

    Args:
        host: name or address by which browsers reach the page.

    Raises:
        MissingExtraError: the package cryptography is not installed.
    """
    with needs("https", "Certificates"):
        from cryptography import x509
        from cryptography.hazmat.primitives import hashes, serialization
        from cryptography.hazmat.primitives.asymmetric import ec

    key, now = ec.generate_private_key(ec.SECP256R1()), datetime.datetime.now(datetime.UTC)
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "cinegen")])
    names: list[x509.GeneralName] = [x509.DNSName("localhost"), x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]
    try:
        names.append(x509.IPAddress(ipaddress.ip_address(host)))
    except ValueError:
        names.append(x509.DNSName(host))
    certificate = (
        x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number(), now - _BACK, now + _VALID)
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .sign(key, hashes.SHA256())
    )
    private = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    file, path = tempfile.mkstemp()
    try:
        with os.fdopen(file, "wb") as stream:
            stream.write(private + certificate.public_bytes(serialization.Encoding.PEM))
        context.load_cert_chain(path)
    finally:
        os.unlink(path)
    return PageCertificate(context, certificate.fingerprint(hashes.SHA256()).hex(":").upper())
