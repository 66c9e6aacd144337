"""An S3 server for tests: OpenStack Swift with its s3api, in one process and one folder.

    /usr/bin/python3 swift_server.py FOLDER [HOST:]PORT BUCKET      prints `ready` when it listens

With port 0 it takes a free one. Which one it is stands in FOLDER/port once it listens.

Swift is one proxy and three kinds of storage servers. All four run here in one process, on one
folder, without replicas; what they have answered is in files, so that the process may be killed and
started again on the same folder. Requests must be signed (version 4) with ACCESS_KEY and SECRET_KEY.

Needs Debian's python3-swift and a file system with extended attributes.
"""

import json
import os
import sys

import eventlet
eventlet.patcher.monkey_patch()

from eventlet import wsgi  # noqa: E402
from swift.common import utils  # noqa: E402
from swift.common.ring import RingBuilder  # noqa: E402
from swift.common.swob import Request  # noqa: E402
from swift.common.wsgi import SwiftHttpProtocol, loadapp  # noqa: E402

ACCESS_KEY, SECRET_KEY = "test:litags", "a-secret-of-tests"
ACCOUNT = "AUTH_test"
DEVICE = "disk"
PARTS = 4  # 2^PARTS partitions of a ring
KINDS = ("account", "container", "object")

COMMON = """
[DEFAULT]
swift_dir = {folder}
devices = {folder}/devices
mount_check = false
disable_fallocate = true
fallocate_reserve = 0
bind_ip = 127.0.0.1
bind_port = {port}
log_level = CRITICAL
"""
PROXY = COMMON + """
[pipeline:main]
pipeline = catch_errors s3api tempauth copy slo dlo proxy-server
[app:proxy-server]
use = egg:swift#proxy
account_autocreate = true
node_timeout = 60
[filter:catch_errors]
use = egg:swift#catch_errors
[filter:s3api]
use = egg:swift#s3api
location = us-east-1
min_segment_size = 5242880
[filter:tempauth]
use = egg:swift#tempauth
user_test_litags = {secret} .admin
[filter:copy]
use = egg:swift#copy
[filter:slo]
use = egg:swift#slo
[filter:dlo]
use = egg:swift#dlo
"""
STORAGE = COMMON + """
[pipeline:main]
pipeline = {kind}-server
[app:{kind}-server]
use = egg:swift#{kind}
"""


class Cache:
    """Stands in for memcached, which tempauth insists on."""

    def __init__(self):
        self.values = {}

    def get(self, key, **_):
        return self.values.get(key)

    def set(self, key, value, **_):
        self.values[key] = value

    def delete(self, key, **_):
        self.values.pop(key, None)

    def incr(self, key, delta=1, **_):
        self.values[key] = self.values.get(key, 0) + int(delta)
        return self.values[key]


def listen(port, host="127.0.0.1"):
    return eventlet.listen((host, port), reuse_addr=True)


def port_of(listener):
    return listener.getsockname()[1]


def storage_listeners(folder):
    """Of the storage servers. Rings name their ports, so that they stay what they were."""
    path = os.path.join(folder, "ports.json")
    if os.path.exists(path):
        with open(path) as file:
            return {kind: listen(port) for kind, port in json.load(file).items()}
    listeners = {kind: listen(0) for kind in KINDS}
    with open(path, "w") as file:
        json.dump({kind: port_of(listener) for kind, listener in listeners.items()}, file)
    return listeners


def make_rings(folder, ports):
    for kind in KINDS:
        path = os.path.join(folder, f"{kind}.ring.gz")
        if os.path.exists(path):
            continue
        builder = RingBuilder(PARTS, 1, 1)
        builder.add_dev({"id": 0, "region": 1, "zone": 1, "ip": "127.0.0.1", "weight": 1,
                         "port": ports[kind], "device": DEVICE})
        builder.rebalance()
        builder.get_ring().save(path)


def write_settings(folder, ports):
    os.makedirs(os.path.join(folder, "devices", DEVICE), exist_ok=True)
    texts = {"swift": "[swift-hash]\nswift_hash_path_prefix = litags\n[storage-policy:0]\n"
                      "name = one\ndefault = yes\n",
             "proxy": PROXY.format(folder=folder, port=ports["proxy"], secret=SECRET_KEY)}
    for kind in KINDS:
        texts[kind] = STORAGE.format(folder=folder, port=ports[kind], kind=kind)
    for name, text in texts.items():
        with open(os.path.join(folder, f"{name}.conf"), "w") as file:
            file.write(text)


def serve(app, listener):
    eventlet.spawn_n(wsgi.server, listener, app, utils.NullLogger(), protocol=SwiftHttpProtocol,
                     capitalize_response_headers=False, log_output=False)


def main(folder, address, bucket):
    host, _, port = address.rpartition(":")
    os.environ["TZ"] = "UTC+0"
    folder = os.path.abspath(folder)
    listeners = storage_listeners(folder)
    ports = {kind: port_of(listener) for kind, listener in listeners.items()}
    ports["proxy"] = int(port)
    write_settings(folder, ports)
    utils.set_swift_dir(folder)
    utils.validate_hash_conf()
    from swift.common import storage_policy
    storage_policy.reload_storage_policies()
    make_rings(folder, ports)
    for kind in KINDS:
        serve(loadapp(os.path.join(folder, f"{kind}.conf")), listeners[kind])
    proxy = loadapp(os.path.join(folder, "proxy.conf"))
    cache = Cache()

    def cached(environment, start_response):
        environment["swift.cache"] = cache
        return proxy(environment, start_response)

    made = Request.blank(f"/v1/{ACCOUNT}/{bucket}", environ={
        "REQUEST_METHOD": "PUT", "swift.authorize_override": True, "swift.authorize": lambda _: None,
        "swift.cache": cache}).get_response(proxy._pipeline_final_app)
    if made.status_int // 100 != 2:
        sys.exit(f"the bucket cannot be made: {made.status}")
    listener = listen(int(port), host or "127.0.0.1")
    serve(cached, listener)
    with open(os.path.join(folder, "port.new"), "w") as file:
        file.write(str(port_of(listener)))
    os.rename(file.name, os.path.join(folder, "port"))
    print("ready", flush=True)
    while True:
        eventlet.sleep(3600)


if __name__ == "__main__":
    main(*sys.argv[1:])
