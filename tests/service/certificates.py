"""Certificates for tests of TLS, as docs/operations.md tells, made by the program openssl."""

import os
import subprocess


def make(folder):
    """ca.crt, server.crt and server.key. Returns the flags that have a server show its own."""
    at = lambda name: os.path.join(folder, name)  # noqa: E731
    _openssl("req", "-x509", *_new_key(folder, "ca"), "-days", "1", "-subj", "/CN=test authority",
             "-out", at("ca.crt"))
    with open(at("san"), "w") as file:
        file.write("subjectAltName=IP:127.0.0.1,DNS:localhost\n")
    issue(folder, "server")
    return ("--tls-cert", at("server.crt"), "--tls-key", at("server.key"))


def issue(folder, name):
    """`name`.crt and `name`.key by the authority of make(): others each time."""
    at = lambda name: os.path.join(folder, name)  # noqa: E731
    _openssl("req", *_new_key(folder, name), "-subj", f"/CN={name}", "-out", at(f"{name}.csr"))
    _openssl("x509", "-req", "-in", at(f"{name}.csr"), "-CA", at("ca.crt"), "-CAkey", at("ca.key"),
             "-CAcreateserial", "-days", "1", "-extfile", at("san"), "-out", at(f"{name}.crt"))


def _new_key(folder, name):
    return ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-keyout",
            os.path.join(folder, f"{name}.key"))


def _openssl(*args):
    subprocess.run(["openssl", *args], check=True, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL)
