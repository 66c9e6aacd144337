"""Finds loops over folders that throw: a range-for increments the iterator without an error code,
also where the iterator was made with one."""

import re

import arrows

LOOP = re.compile(r"\bfor\s*\([^;(){}]*[^:]:\s*(?:std::filesystem::|fs::)?"
                  r"(?:recursive_)?directory_iterator\s*[({]")


def problems(path, text):
    """What is wrong with the loops of one file; tests may throw."""
    if arrows.is_of_tests(path):
        return
    for loop in LOOP.finditer(text):
        line = text.count("\n", 0, loop.start()) + 1
        yield (f"{path}:{line}: a range-for over a directory_iterator throws; use ListNames() of "
               "engine/io/file_util.h, or it.increment(error)")
