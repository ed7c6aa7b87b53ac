"""A page by HTTPS: its own certificate, and everything encrypted."""

from __future__ import annotations

import asyncio
import hashlib
import json
import ssl
import urllib.error
import urllib.request
from ssl import CERT_NONE

import pytest
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

from cinegen.cockpit import Cockpit
from cinegen.cockpit.certificate import self_signed
from cinegen.session import Setup


@pytest.fixture(scope="module")
def cockpit(robot):
    with Cockpit(Setup({"four_bar": robot("four_bar")}), port=0, https=True) as one:
        yield one


def trusting():
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, CERT_NONE
    return context


def test_the_page_has_the_certificate_whose_fingerprint_is_printed(cockpit):
    server = cockpit.server
    found = ssl.get_server_certificate(("127.0.0.1", server.port))
    digest = hashlib.sha256(ssl.PEM_cert_to_DER_cert(found)).hexdigest().upper()
    assert server.certificate.fingerprint == ":".join(digest[i : i + 2] for i in range(0, 64, 2))
    assert server.local_url.startswith("https://127.0.0.1:")
    with urllib.request.urlopen(server.local_url, context=trusting(), timeout=5) as answer:
        assert answer.status == 200


def test_who_trusts_that_certificate_alone_is_connected_and_nobody_in_clear(cockpit, tmp_path):
    server, path = cockpit.server, tmp_path / "certificate.pem"
    path.write_text(ssl.get_server_certificate(("127.0.0.1", server.port)))
    context = ssl.create_default_context(cafile=str(path))  # the name is checked, too
    with urllib.request.urlopen(server.local_url, context=context, timeout=5) as answer:
        assert answer.status == 200
    with pytest.raises(ConnectionError):
        urllib.request.urlopen(server.local_url.replace("https:", "http:"), timeout=5)
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(server.local_url.partition("?")[0], context=context, timeout=5)


def test_the_session_is_encrypted_too(cockpit):
    async def first():
        request = HTTPRequest(cockpit.server.session_url, ssl_options=trusting())
        line = await websocket_connect(request)
        try:
            return json.loads(await line.read_message())
        finally:
            line.close()

    assert cockpit.server.session_url.startswith("wss://")
    assert asyncio.run(first())["type"] == "hello"


@pytest.mark.parametrize("host", ["127.0.0.1", "192.168.1.20", "robot-pc", "::1"])
def test_certificates_are_of_any_host(host):
    one, other = self_signed(host), self_signed(host)
    assert one.fingerprint != other.fingerprint
