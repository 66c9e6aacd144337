"""The little of an S3 client that tests need: the keys in a bucket."""

import datetime
import hashlib
import hmac
import re
import urllib.parse
import urllib.request

REGION = "us-east-1"


def signed(host, path, query, access_key, secret_key):
    """Headers of a GET, signed as AWS's documentation, "Create a signed AWS API request", asks."""
    now = datetime.datetime.now(datetime.timezone.utc).strftime("%Y%m%dT%H%M%SZ")
    empty = hashlib.sha256(b"").hexdigest()
    scope = f"{now[:8]}/{REGION}/s3/aws4_request"
    names = "host;x-amz-content-sha256;x-amz-date"
    canonical = (f"GET\n{path}\n{query}\nhost:{host}\nx-amz-content-sha256:{empty}\n"
                 f"x-amz-date:{now}\n\n{names}\n{empty}")
    text = f"AWS4-HMAC-SHA256\n{now}\n{scope}\n{hashlib.sha256(canonical.encode()).hexdigest()}"
    key = f"AWS4{secret_key}".encode()
    for part in scope.split("/"):
        key = hmac.digest(key, part.encode(), "sha256")
    signature = hmac.digest(key, text.encode(), "sha256").hex()
    return {"x-amz-date": now, "x-amz-content-sha256": empty,
            "authorization": f"AWS4-HMAC-SHA256 Credential={access_key}/{scope}, "
                             f"SignedHeaders={names}, Signature={signature}"}


def keys(host, bucket, access_key, secret_key):
    """All keys in the bucket at host:port."""
    found, token = [], ""
    while True:
        query = [("continuation-token", token)] if token else []
        query = urllib.parse.urlencode(sorted([*query, ("list-type", "2")]),
                                       quote_via=urllib.parse.quote)
        headers = signed(host, f"/{bucket}", query, access_key, secret_key)
        request = urllib.request.Request(f"http://{host}/{bucket}?{query}", headers=headers)
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        with opener.open(request, timeout=30) as answer:
            page = answer.read().decode()
        found += re.findall("<Key>(.*?)</Key>", page)
        token = "".join(re.findall("<NextContinuationToken>(.*?)</NextContinuationToken>", page))
        if not token:
            return found
