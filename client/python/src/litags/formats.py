"""What the name of a scene's file says of its format: client/model_format.cc has the same rules."""

import os

from litags.v1 import model_service_pb2

# The first that fits counts.
MODEL_ENDINGS = {
    ".compressed.ply": model_service_pb2.MODEL_FORMAT_COMPRESSED_PLY,
    ".points.ply": model_service_pb2.MODEL_FORMAT_POINTS,
    ".mesh.ply": model_service_pb2.MODEL_FORMAT_MESH_PLY,
    ".mesh.glb": model_service_pb2.MODEL_FORMAT_MESH_GLB,
    ".ply": model_service_pb2.MODEL_FORMAT_PLY,
    ".spz": model_service_pb2.MODEL_FORMAT_SPZ,
    ".sog": model_service_pb2.MODEL_FORMAT_SOG,
    ".splat": model_service_pb2.MODEL_FORMAT_SPLAT,
    ".glb": model_service_pb2.MODEL_FORMAT_GLB,
    ".usda": model_service_pb2.MODEL_FORMAT_USDA,
    ".zip": model_service_pb2.MODEL_FORMAT_COLMAP,
    ".html": model_service_pb2.MODEL_FORMAT_HTML,
    ".las": model_service_pb2.MODEL_FORMAT_LAS,
    ".litags": model_service_pb2.MODEL_FORMAT_LITAGS,
}


def model_format(path: str | os.PathLike[str]) -> model_service_pb2.ModelFormat:
    """The format of the scene's file of this name, which ends as `litags export -o` takes it. Else
    it is a ValueError."""
    name = os.fspath(path).lower()
    for ending, found in MODEL_ENDINGS.items():
        if name.endswith(ending):
            return found
    raise ValueError(f"{path} ends with none of {', '.join(MODEL_ENDINGS)}; rename it, or give format")


def check_ending(path: str | os.PathLike[str], wanted: model_service_pb2.ModelFormat) -> None:
    """ValueError if the name ends as files of another format do."""
    word = model_service_pb2.ModelFormat.Name(wanted)
    right = "." + word.split("_")[2].lower()  # MODEL_FORMAT_PLY_FULL, MODEL_FORMAT_SPZ_V4
    given = ""
    for ending, found in MODEL_ENDINGS.items():
        last = ending[ending.rindex("."):]
        if found == wanted:
            right = last
        # The longest: x.points.ply is no .ply of Gaussians.
        if not given and os.fspath(path).lower().endswith(ending):
            given = last if found == wanted else ending
    if given not in ("", right):
        better = os.fspath(path)[:-len(given)] + right
        raise ValueError(f"{path}: what is asked for is {word}, not {given}; call it {better}, or "
                         "leave format out")
