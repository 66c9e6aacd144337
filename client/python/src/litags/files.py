"""Files on disk as the service wants them announced, and the messages of an upload."""

import hashlib
import os
import pathlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from litags.v1 import reconstruction_service_pb2 as rpc

Path = str | os.PathLike[str]

PHOTO_ENDINGS = frozenset(
    ".jpg .jpeg .png .tif .tiff .webp .heic .heif .hif .avif .jxl .dng .nef .nrw .cr2 .cr3 .arw "
    ".raf .orf .rw2 .pef .srw".split())
CHUNK_BYTES = 256 << 10


@dataclass(frozen=True)
class File:
    path: pathlib.Path
    role: rpc.FileRole
    size: int
    sha256: bytes

    @classmethod
    def read(cls, path: pathlib.Path, role: rpc.FileRole) -> "File":
        try:
            path.name.encode()
        except UnicodeEncodeError:
            raise ValueError(f"{os.fsencode(path)!r}: the file's name is not UTF-8; "
                             "rename it") from None
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").digest()
        return cls(path, role, path.stat().st_size, digest)

    def header(self, offset: int = 0) -> rpc.FileHeader:
        return rpc.FileHeader(name=self.path.name, role=self.role, size_bytes=self.size,
                              sha256=self.sha256, offset=offset)


def find_photos(photos: Path | Iterable[Path]) -> list[File]:
    """All photos of a folder, or those of a list."""
    if isinstance(photos, (str, os.PathLike)):
        folder = pathlib.Path(photos)
        paths = sorted(path for path in folder.iterdir()
                       if path.suffix.lower() in PHOTO_ENDINGS and path.name[0] != ".")
        if not paths:
            raise ValueError(f"{folder} holds no photos")
    else:
        paths = [pathlib.Path(photo) for photo in photos]
    return [File.read(path, rpc.FILE_ROLE_PHOTO) for path in paths]


def find_cameras(cameras: Path) -> list[File]:
    """A transforms.json, or the three files of a COLMAP model in a folder."""
    path = pathlib.Path(cameras)
    if not path.is_dir():
        return [File.read(path, rpc.FILE_ROLE_CAMERAS)]
    ending = ".bin" if (path / "cameras.bin").exists() else ".txt"
    return [File.read(path / f"{stem}{ending}", rpc.FILE_ROLE_COLMAP)
            for stem in ("cameras", "images", "points3D")]


def upload_messages(job: str, files: Sequence[File],
                    offsets: Sequence[int]) -> Iterator[rpc.UploadImagesRequest]:
    """The messages of one stream, with each file's bytes from its offset on."""
    yield rpc.UploadImagesRequest(name=job)
    for file, offset in zip(files, offsets, strict=True):
        yield rpc.UploadImagesRequest(file=file.header(offset))
        with file.path.open("rb") as source:
            source.seek(offset)
            while chunk := source.read(CHUNK_BYTES):
                yield rpc.UploadImagesRequest(chunk=chunk)
    # Without its end a stream that was cut short looks whole.
    yield rpc.UploadImagesRequest(end=rpc.UploadEnd(files=len(files)))
