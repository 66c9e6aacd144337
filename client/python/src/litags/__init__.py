"""Client of the litags service: photos in, pictures in normal light out."""

from litags.client import Client
from litags.errors import LitagsError
from litags.formats import model_format

__all__ = ["Client", "LitagsError", "model_format"]
