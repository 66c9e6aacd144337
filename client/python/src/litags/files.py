"""Files on disk as the service wants them announced, and the messages of an upload."""

import hashlib
import logging
import os
import pathlib
import re
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import dataclass

from litags import errors
from litags.v1 import reconstruction_service_pb2 as rpc

Path = str | os.PathLike[str]
_log = logging.getLogger("litags")

PHOTO_ENDINGS = frozenset(
    ".jpg .jpeg .jpe .jfif .png .tif .tiff .webp .heic .heif .hif .avif .jxl .dng .nef .nrw .cr2 .cr3 .arw "
    ".raf .orf .rw2 .pef .srw".split())
VIDEO_ENDINGS = frozenset(".mp4 .mov .m4v .3gp .mkv .webm .avi .mts .m2ts .ts".split())
ARCHIVE_ENDINGS = (".zip", ".tar", ".tar.gz", ".tgz")
DEPTH_ENDINGS = (".npy", ".pfm", ".png")
# As their programs name them.
CAMERAS_FILES = ("transforms.json", "sfm_data.json", "cameras.sfm", "cameras.xml", "bundle.out")
CHUNK_BYTES = 256 << 10
MIN_PHOTOS = 3  # the service's: fewer make no scene
# What would steer a terminal, and bytes that are not UTF-8, as the program litags has it.
_NOT_SHOWN = re.compile(r"[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


@dataclass(frozen=True)
class File:
    path: pathlib.Path
    role: rpc.FileRole
    size: int
    sha256: bytes
    tail: bytes = b""  # goes up after the bytes at path
    trouble: OSError | ValueError | None = None  # why it cannot be sent

    @classmethod
    def read(cls, path: pathlib.Path, role: rpc.FileRole, tail: bytes = b"") -> "File":
        try:
            if not _has_utf8_name(path):
                raise ValueError(f"{os.fsencode(path)!r}: the file's name is not UTF-8; rename it")
            if path.exists() and not path.is_file():  # to open a pipe would take forever
                raise ValueError(f"{str(path)!r} is not a file")
            with path.open("rb") as file:
                digest = hashlib.file_digest(file, "sha256")
            digest.update(tail)
            return cls(path, role, path.stat().st_size + len(tail), digest.digest(), tail)
        except (OSError, ValueError) as error:
            return cls(path, role, 0, b"", tail, error)

    def header(self, offset: int = 0) -> rpc.FileHeader:
        return rpc.FileHeader(file_name=self.path.name, role=self.role, size_bytes=self.size,
                              sha256=self.sha256, offset=offset)


def find_photos(photos: Path | Iterable[Path]) -> list[File]:
    """All photos of a folder, those of a list, a video, or an archive of a folder."""
    if not isinstance(photos, (str, os.PathLike)):
        paths = [pathlib.Path(photo) for photo in photos]
        names = sorted(photo.name for photo in paths)
        for name, other in zip(names, names[1:]):
            if name == other:
                raise ValueError(f"two photos are called {name}: only names are sent, so that one "
                                 "would replace the other; rename one")
        return [File.read(photo, rpc.FILE_ROLE_PHOTO) for photo in paths]
    path = pathlib.Path(photos)
    if path.suffix.lower() in VIDEO_ENDINGS:
        return [File.read(path, rpc.FILE_ROLE_VIDEO)]
    if path.name.lower().endswith(ARCHIVE_ENDINGS):
        return [File.read(path, rpc.FILE_ROLE_ARCHIVE)]
    if path.is_file():
        raise ValueError(f"{path} is a file; give the folder that holds the photos, or rename a video to "
                         f"end in one of {' '.join(sorted(VIDEO_ENDINGS))}, an archive in one of "
                         f"{' '.join(ARCHIVE_ENDINGS)}")
    paths = _files_of(path, PHOTO_ENDINGS)
    if not paths:
        raise ValueError(f"{path} holds no photos; give the folder that does: of a dataset its images")
    return [File.read(photo, rpc.FILE_ROLE_PHOTO) for photo in paths]


def _has_utf8_name(path: pathlib.Path) -> bool:
    try:
        path.name.encode()
        return True
    except UnicodeEncodeError:
        return False


def sendable(found: list[File], strict: bool) -> list[File]:
    """Without the photos that cannot be sent from here, as a link to what is gone, and their masks, if
    enough others remain; without masks whose names cannot be sent, and broken depth maps of no other
    photo. Raises the trouble of any other file, with `strict` of any. client/upload.cc has the same
    rule."""
    for file in [file for file in found if file.trouble]:  # photos are the first
        if file not in found:  # a mask that went with its photo
            continue
        if strict or not _may_be_left_out(file, found):
            raise file.trouble
        found = leave_out(file, str(file.trouble), found)
    return found


def _may_be_left_out(file: File, found: Iterable[File]) -> bool:
    photos = [other for other in found if other.role == rpc.FILE_ROLE_PHOTO and not other.trouble]
    if file.role == rpc.FILE_ROLE_PHOTO:
        return len(photos) >= MIN_PHOTOS
    if file.role == rpc.FILE_ROLE_MASK:  # cameras may say whose it is, but not by such a name
        return not _has_utf8_name(file.path)
    # Depth maps are named as masks are.
    return file.role == rpc.FILE_ROLE_DEPTH and not any(_is_mask_of(photo, file) for photo in photos)


def leave_out(file: File, why: str, found: list[File]) -> list[File]:
    """The others, of a photo without the masks of no other; says so."""
    masks = masks_only_of(file, found) if file.role == rpc.FILE_ROLE_PHOTO else []
    names = "".join(f", {mask.path.name}" for mask in masks).replace(",", ", with", 1)
    _log.warning("%s", _NOT_SHOWN.sub("?", f"{file.path.name} is left out{names}: {why}"))
    return [other for other in found if other is not file and other not in masks]


def refused_photo(found: Iterable[File], error: errors.LitagsError) -> File | None:
    """The photo that `error` says the service cannot read, or whose name it does not take, if enough
    others remain."""
    if not error.reason.startswith("IMAGE_") and error.reason not in ("FILE_EMPTY", "BAD_FILE_NAME"):
        return None
    photos = [file for file in found if file.role == rpc.FILE_ROLE_PHOTO]
    if len(photos) <= MIN_PHOTOS:
        return None
    return next((file for file in photos if error.field == f"images[{file.path.name}]"), None)


def _is_mask_of(photo: File, mask: File) -> bool:
    # As the service has it: "_mask" and ".mask" in any case.
    stem = mask.path.stem
    stems = {stem, re.sub(r"[_.]mask$", "", stem, flags=re.IGNORECASE)}
    return not stems.isdisjoint((photo.path.name, photo.path.stem))


def masks_only_of(photo: File, found: Iterable[File]) -> list[File]:
    """Photos of one stem share a mask."""
    found = list(found)
    others = [file for file in found if file.role == rpc.FILE_ROLE_PHOTO and file is not photo]
    return [mask for mask in found
            if mask.role == rpc.FILE_ROLE_MASK and _is_mask_of(photo, mask)
            and not any(_is_mask_of(other, mask) for other in others)]


def find_masks(folder: Path) -> list[File]:
    """All masks of a folder, each named after its photo."""
    masks = _files_of(pathlib.Path(folder), {".png"})
    if not masks:
        raise ValueError(f"{folder} holds no masks (.png); name them <photo's name>.png, or remove "
                         "the folder")
    return [File.read(mask, rpc.FILE_ROLE_MASK) for mask in masks]


def find_depth(folder: Path) -> list[File]:
    """All depth maps of a folder, each named after its photo (docs/depth.md)."""
    maps = _files_of(pathlib.Path(folder), DEPTH_ENDINGS)
    if not maps:
        raise ValueError(f"{folder} holds no depth maps ({' '.join(DEPTH_ENDINGS)}); name them "
                         "<photo's name>.npy, or leave depth out")
    return [File.read(path, rpc.FILE_ROLE_DEPTH) for path in maps]


def masks_beside(photos: Path | Iterable[Path]) -> pathlib.Path | None:
    """The folder "masks" of a folder of photos, if there is one."""
    if not isinstance(photos, (str, os.PathLike)):
        return None
    folder = pathlib.Path(photos, "masks")
    return folder if folder.is_dir() else None


def find_cameras(cameras: Path) -> list[File]:
    """A file of cameras (docs/cameras.md), or the files of a COLMAP model; points are optional. Of a
    folder, what `litags submit --cameras` takes."""
    path = _cameras_of(pathlib.Path(cameras))
    if not path.is_dir():
        return [File.read(path, rpc.FILE_ROLE_CAMERAS, _bundler_list(path))]
    ending = ".bin" if (path / "cameras.bin").exists() else ".txt"
    files = [path / f"{stem}{ending}" for stem in ("cameras", "images", "points3D")]
    # COLMAP's recipe for known poses makes points3D.txt with nothing in it.
    if not files[2].exists() or (ending == ".txt" and files[2].stat().st_size == 0):
        del files[2]
    return [File.read(file, rpc.FILE_ROLE_COLMAP) for file in files]


def _cameras_of(path: pathlib.Path) -> pathlib.Path:
    """The folder itself, if it is a COLMAP model, or what is in it: the largest model of its folder
    sparse, a file of cameras, or a model in another folder. client/cameras_source.cc has the same
    rule."""
    if not path.is_dir() or _is_model(path):
        return path
    files = [path / name for name in CAMERAS_FILES if (path / name).is_file()]
    for found in (_models_of(path / "sparse"), files, _models_of(path),
                  _models_of(path / "colmap/sparse"), _models_of(path / "colmap")):
        if found:
            return found[0]
    raise ValueError(f"{path} has neither a COLMAP model nor {', '.join(CAMERAS_FILES)}; give the "
                     "file or the folder of the cameras")


def _is_model(folder: pathlib.Path) -> bool:
    return (folder / "cameras.bin").exists() or (folder / "cameras.txt").exists()


def _models_of(folder: pathlib.Path) -> list[pathlib.Path]:
    """The folder itself and those in it that are COLMAP models, the largest first."""
    inside = sorted(folder.iterdir()) if folder.is_dir() else []
    return sorted(filter(_is_model, [folder, *inside]), key=_images_of, reverse=True)


def _images_of(model: pathlib.Path) -> int:
    """The number that images.bin begins with, else the lines of images.txt that end in a name."""
    if (model / "images.bin").exists():
        with (model / "images.bin").open("rb") as file:
            return int.from_bytes(file.read(8), "little")
    text = model / "images.txt"
    lines = text.read_text(errors="replace").splitlines() if text.exists() else []
    words = [line.split() for line in lines]
    return sum(not _is_number(line[-1]) for line in words if line and line[0][0] != "#")


def _is_number(word: str) -> bool:
    try:
        float(word)
        return True
    except ValueError:
        return False


def _bundler_list(cameras: pathlib.Path) -> bytes:
    """The photos' names, which Bundler keeps beside bundle.out, RealityScan in the only *.lst: the
    service takes both as one."""
    with cameras.open("rb") as file:
        if b"# Bundle file" not in file.readline(100):
            return b""
    stem = cameras.name.removesuffix(".out").removesuffix(".bundle")
    others = list(cameras.absolute().parent.glob("*.lst"))
    for path in (cameras.with_name(f"{stem}.list.txt"), cameras.with_name("list.txt"),
                 *(others if len(others) == 1 else ())):
        if path.is_file():
            return b"\n" + path.read_bytes()
    return b""


def _files_of(folder: pathlib.Path, endings: Container[str]) -> list[pathlib.Path]:
    return sorted(path for path in folder.iterdir()
                  if path.suffix.lower() in endings and path.name[0] != "." and not path.is_dir())


def content_digest(found: Iterable[File]) -> bytes:
    """Of roles, names and contents, for CreateJobRequest: client/upload.cc has the same recipe."""
    digest = hashlib.sha256()
    for file in sorted(found, key=lambda file: (file.role, file.path.name.encode())):
        digest.update(f"{int(file.role)}/{file.path.name}\n".encode() + file.sha256)
    return digest.digest()


def turns(found: Iterable[File]) -> tuple[list[File], list[File]]:
    """What a job cannot start with if it is wrong, and the rest: if one is refused, no photo has been
    sent."""
    first_roles = (rpc.FILE_ROLE_CAMERAS, rpc.FILE_ROLE_COLMAP, rpc.FILE_ROLE_DEPTH)
    first: list[File] = []
    rest: list[File] = []
    for file in found:
        (first if file.role in first_roles else rest).append(file)
    return first, rest


def upload_messages(job: str, files: Sequence[File],
                    offsets: Sequence[int]) -> Iterator[rpc.UploadImagesRequest]:
    """The messages of one stream, with each file's bytes from its offset on."""
    yield rpc.UploadImagesRequest(name=job)
    for file, offset in zip(files, offsets, strict=True):
        yield rpc.UploadImagesRequest(file=file.header(offset))
        on_disk = file.size - len(file.tail)
        left = max(0, on_disk - offset)
        with file.path.open("rb") as source:
            source.seek(offset)
            while left > 0:
                chunk = source.read(min(left, CHUNK_BYTES))
                if not chunk:
                    raise ValueError(f"{file.path} became shorter while it was sent; submit it "
                                     "again when it is complete")
                left -= len(chunk)
                yield rpc.UploadImagesRequest(chunk=chunk)
        if tail := file.tail[max(0, offset - on_disk):]:
            yield rpc.UploadImagesRequest(chunk=tail)
    # Without its end a stream that was cut short looks whole.
    yield rpc.UploadImagesRequest(end=rpc.UploadEnd(files=len(files)))
