"""A page by HTTPS: its own certificate, and everything encrypted."""

import asyncio
import hashlib
import json
import ssl
import urllib.error
import urllib.request

import pytest
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

from cinegen.cockpit import Cockpit
from cinegen.cockpit.certificate import self_signed
from cinegen.session import Setup


def test_a_page_and_its_session_are_encrypted_with_the_certificate_that_is_printed(robot, tmp_path, caplog):
    with Cockpit(Setup({"four_bar": robot("four_bar")}), port=0, https=True, own_process=False) as cockpit:
        server, path = cockpit.server, tmp_path / "certificate.pem"
        certificate = ssl.get_server_certificate(("127.0.0.1", server.port))
        digest = hashlib.sha256(ssl.PEM_cert_to_DER_cert(certificate)).hexdigest().upper()
        assert server.certificate.fingerprint == ":".join(digest[i : i + 2] for i in range(0, 64, 2))
        path.write_text(certificate)
        context = ssl.create_default_context(cafile=str(path))  # trusts that one alone; the name is checked, too
        with urllib.request.urlopen(server.local_url, context=context, timeout=60) as answer:
            assert answer.status == 200
        with pytest.raises(ConnectionError):
            urllib.request.urlopen(server.local_url.replace("https:", "http:"), timeout=60)
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(server.local_url.partition("?")[0], context=context, timeout=60)

        async def first():
            line = await websocket_connect(HTTPRequest(server.session_url, ssl_options=context))
            try:
                return json.loads(await line.read_message())
            finally:
                line.close()

        assert server.session_url.startswith("wss://")
        assert asyncio.run(first())["type"] == "hello"
    assert not caplog.records  # who spoke HTTP did not write to the terminal


@pytest.mark.parametrize("host", ["robot-pc", "::1"])
def test_certificates_are_of_any_host(host):
    first, other = self_signed(host), self_signed(host)
    assert first.fingerprint != other.fingerprint
