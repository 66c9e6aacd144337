"""How a program that a test started has ended, by its exit code and by its log."""

import re

# ThreadSanitizer and LeakSanitizer report at the end, UBSan ("runtime error:") goes on, and a worker
# that AddressSanitizer ends is replaced: a test that looks at answers alone sees none of them.
REPORT = re.compile(r"^.*(Sanitizer:|runtime error:)", re.MULTILINE)
SHOWN = 5000  # characters of a log


def check_log(log_path):
    """AssertionError if a sanitizer reported something there."""
    with open(log_path, errors="replace") as file:
        log = file.read()
    if report := REPORT.search(log):
        raise AssertionError(f"a sanitizer reported:\n{log[report.start():][:SHOWN]}")
    return log


def check_end(code, log_path, expected=0):
    """AssertionError unless the program ended with this exit code and no sanitizer reported."""
    log = check_log(log_path)
    if code != expected:
        raise AssertionError(f"ended with {code}, not {expected}; its log ends:\n{log[-SHOWN:]}")
