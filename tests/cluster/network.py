"""Networks for the nodes of a cluster on one machine, whose connections can be cut."""

import contextlib
import os
import socket
import subprocess

import harness


def run(*command):
    subprocess.run(command, check=True, capture_output=True, text=True)


class Namespaces:
    """Every node in a network namespace of its own, on a bridge; a cut node's link is down."""

    def __init__(self):
        # Unique on the machine while this process lives; at most 15 letters with a node's number.
        self.name = f"lt{os.getpid()}"
        self.subnet = f"10.213.{os.getpid() % 256}"
        self.nodes = {}  # name: number
        self.gateway = f"{self.subnet}.1"  # where the test itself is
        run("ip", "link", "add", self.name, "type", "bridge")
        run("ip", "address", "add", f"{self.gateway}/24", "dev", self.name)
        run("ip", "link", "set", self.name, "up")

    @staticmethod
    def available():
        if os.geteuid() != 0:
            return False
        try:
            run("ip", "netns", "add", f"lt{os.getpid()}-try")
            run("ip", "netns", "delete", f"lt{os.getpid()}-try")
            return True
        except (OSError, subprocess.CalledProcessError):
            return False

    def add(self, node):
        number = self.nodes[node] = len(self.nodes) + 2
        space, link = self.space(node), self.link(node)
        run("ip", "netns", "add", space)
        run("ip", "link", "add", link, "type", "veth", "peer", "name", "eth0", "netns", space)
        run("ip", "link", "set", link, "master", self.name, "up")
        run("ip", "-netns", space, "address", "add", f"{self.subnet}.{number}/24", "dev", "eth0")
        run("ip", "-netns", space, "link", "set", "lo", "up")
        run("ip", "-netns", space, "link", "set", "eth0", "up")

    def space(self, node):
        return f"{self.name}-{self.nodes[node]}"

    def link(self, node):
        return f"{self.name}v{self.nodes[node]}"

    def prefix(self, node):
        return ["ip", "netns", "exec", self.space(node)]

    def listen(self, node, port):
        """(host, port) where a node that serves listens."""
        return f"{self.subnet}.{self.nodes[node]}", port

    def reach(self, _, address):
        """The address by which a node reaches another one's."""
        return address

    def cut(self, node):
        run("ip", "link", "set", self.link(node), "down")

    def heal(self, node):
        run("ip", "link", "set", self.link(node), "up")

    def close(self):
        for node in self.nodes:
            with contextlib.suppress(subprocess.CalledProcessError):
                run("ip", "netns", "delete", self.space(node))
        with contextlib.suppress(subprocess.CalledProcessError):
            run("ip", "link", "delete", self.name)


class Proxies:
    """Where there are no namespaces: all nodes on loopback, and a relay for every pair of nodes of
    which one reaches the other; a cut node's relays are silent. The test reaches nodes directly."""

    def __init__(self):
        self.relays = {}  # (node, address): relay
        self.ports = {}

    def add(self, node):
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.ports[node] = free.getsockname()[1]

    def prefix(self, _):
        return []

    def listen(self, node, _):
        return "127.0.0.1", self.ports[node]

    def reach(self, node, address):
        key = (node, address)
        if key not in self.relays:
            self.relays[key] = harness.CuttableProxy(address[1])
        host, port = self.relays[key].address.split(":")
        return host, int(port)

    def _of(self, node):
        serves = ("127.0.0.1", self.ports[node])
        return [relay for key, relay in self.relays.items() if key[0] == node or key[1] == serves]

    def cut(self, node):
        for relay in self._of(node):
            relay.silent = True

    def heal(self, node):
        for relay in self._of(node):
            relay.silent = False
            relay.cut()  # what was swallowed is lost: these connections cannot go on

    def close(self):
        for relay in self.relays.values():
            relay.close()


def make():
    return Namespaces() if Namespaces.available() else Proxies()
