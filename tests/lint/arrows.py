"""Reads which folders may include which from docs/architecture.md, and checks the code against it."""

import pathlib
import re

PAGE = "docs/architecture.md"
INCLUDE = re.compile(r'^\s*#\s*include\s*(?:"([^"]+)"|<([^>]+)>)', re.MULTILINE)
ROW = re.compile(r"^\| `([^`]+)`[^|]*\|[^|]*\|([^|]*)\|$", re.MULTILINE)
# Tests check a folder through others, so they may include all of their layer and what that uses.
TEST_FILE = re.compile(r"test|conformance|^fake_|^reference_renderer|^scalar_match")
# Every folder of these layers may include it.
FOR_ALL = {"engine": "engine/core", "server": "engine/core"}


def is_of_tests(path):
    pure = pathlib.PurePath(path)
    return bool(path.startswith("tests/") or TEST_FILE.search(pure.name)
                or "testing" in pure.parent.parts)


class PageError(Exception):
    """The page's tables cannot be read, or contradict themselves."""


class Arrows:
    """The tables of the page. `folders`: {folder: folders that it may include}."""

    def __init__(self, page):
        _, _, after = page.partition("\n| Folder | Owns | May include |\n")
        folders, _, libraries = after.partition("\n| Library | Header | Only in |\n")
        if not folders or not libraries:
            raise PageError(f"{PAGE}: there must be a table of folders, then one of libraries")
        rows = dict(ROW.findall(folders))
        self.folders = {folder: self._resolve(folder, text, rows) for folder, text in rows.items()}
        # (pattern of the header, folders that may include it)
        self.libraries = []
        for headers, text in re.findall(r"^\|[^|]*\|([^|]*)\|([^|]*)\|$", libraries, re.MULTILINE):
            patterns = [re.escape(h).replace(r"\*", ".*") for h in re.findall(r"`([^`]+)`", headers)]
            if patterns:
                self.libraries.append((re.compile("|".join(patterns)), _names(text)))
        if not self.libraries:
            raise PageError(f"{PAGE}: the table of libraries has no rows")
        circle = find_circle(self.folders)
        if circle:
            raise PageError(f"{PAGE}: the arrows go in a circle: {' -> '.join(circle)}")

    @staticmethod
    def _resolve(folder, text, rows):
        layer = folder.split("/")[0]
        found = {FOR_ALL[layer]} - {folder} if layer in FOR_ALL else set()
        for name in _names(text):
            if name.startswith("all of "):
                whole = name.removeprefix("all of ")
                found |= {r for r in rows if r.startswith(whole + "/") and r != folder}
                continue
            full = name if name in rows else f"{layer}/{name}"
            if full not in rows:
                raise PageError(f"{PAGE}: {folder} may include {name}, which has no row")
            found.add(full)
        return found

    def folder_of(self, path):
        """The row that `path` belongs to, or None."""
        parts = path.split("/")
        for length in range(len(parts) - 1, 0, -1):
            if "/".join(parts[:length]) in self.folders:
                return "/".join(parts[:length])
        return None

    def target_of(self, header):
        """The row of an included header; "" if it is none of ours."""
        if header.startswith("litags/"):
            inside = "proto/" if header.startswith("litags/v1/") else "engine/include/"
            return self.folder_of(inside + header)
        if header.split("/")[0] in ("engine", "server", "client", "tests", "proto"):
            return self.folder_of(header)
        return ""

    def problems(self, path, text):
        """What is wrong with the includes of one file."""
        if path.startswith("tests/"):
            return
        folder = self.folder_of(path)
        if folder is None:
            yield f"{path}: its folder has no row in {PAGE}; add one"
            return
        layer = folder.split("/")[0]
        is_test = is_of_tests(path)
        may = self.folders[folder]
        if is_test:
            may = set().union(*({f} | to for f, to in self.folders.items()
                                if f.split("/")[0] == layer))
        for quoted, angled in INCLUDE.findall(text):
            header = quoted or angled
            for pattern, where in self.libraries:
                allowed = folder in where or (is_test and layer in {w.split("/")[0] for w in where})
                if pattern.match(header) and not allowed:
                    yield (f'{path}: includes "{header}", which {PAGE} allows only in '
                           f"{', '.join(sorted(where))}")
            if is_test and header.startswith("tests/"):
                continue
            target = self.target_of(header) if quoted else ""
            if target is None:
                yield f'{path}: includes "{header}", whose folder has no row in {PAGE}'
            elif target and target != folder and target not in may:
                yield f'{path}: includes "{header}", but {PAGE} has no arrow {folder} -> {target}'


def _names(text):
    return {name.strip().strip("`") for name in text.split(",") if name.strip()}


def find_circle(graph):
    """A circle of `graph` {node: nodes} as a list that ends where it starts, or None."""
    done, trail = set(), []

    def visit(node):
        if node in trail:
            return trail[trail.index(node):] + [node]
        if node in done:
            return None
        trail.append(node)
        for after in sorted(graph.get(node, ())):
            if circle := visit(after):
                return circle
        trail.pop()
        done.add(node)
        return None

    for node in sorted(graph):
        if circle := visit(node):
            return circle
    return None
