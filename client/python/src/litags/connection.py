"""How to reach a server, from the environment variables of the program `litags`."""

import ipaddress
import pathlib
from collections.abc import Mapping
from typing import Any

import grpc


def options_of(environment: Mapping[str, str], server: str = "") -> dict[str, Any]:
    """What `Client` takes, by LITAGS_SERVER (unless `server` names one), LITAGS_TOKEN and others."""
    server = server or environment.get("LITAGS_SERVER") or "127.0.0.1:50051"
    return {"server": server, "token": _token(environment),
            "credentials": _credentials(environment),
            "tls_name": environment.get("LITAGS_TLS_NAME", "")}


def is_this_machine(server: str) -> bool:
    if server.startswith("unix:"):
        return True
    host = server.rpartition(":")[0].strip("[]")
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _token(environment: Mapping[str, str]) -> str:
    if path := environment.get("LITAGS_TOKEN_FILE"):
        return pathlib.Path(path).read_text().strip()
    return environment.get("LITAGS_TOKEN", "")


def _credentials(environment: Mapping[str, str]) -> grpc.ChannelCredentials | None:
    """For a server with TLS; None for one without."""
    names = ("LITAGS_TLS_CA", "LITAGS_TLS_KEY", "LITAGS_TLS_CERT")
    wanted = environment.get("LITAGS_TLS", "").lower() not in ("", "0", "false", "no", "off")
    if not wanted and not any(map(environment.get, (*names, "LITAGS_TLS_NAME"))):
        return None
    ca, key, certificate = (pathlib.Path(path).read_bytes() if path else None
                            for path in map(environment.get, names))
    if (key is None) != (certificate is None):
        raise ValueError("LITAGS_TLS_CERT and LITAGS_TLS_KEY belong together; set both")
    return grpc.ssl_channel_credentials(ca, key, certificate)
