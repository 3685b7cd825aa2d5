"""The bytes of an upload, from a multipart form or the raw body."""

from dataclasses import dataclass
from pathlib import PurePath

from fastapi import Request
from starlette.datastructures import UploadFile
from starlette.formparsers import MultiPartException, MultiPartParser

from model.errors import MalformedFile, UnknownFormat
from model.loading import FORMATS

MULTIPART = "multipart/form-data"
# Types that say nothing of the format: the name, if any, and the content decide.
# (curl --data-binary declares a form unless told otherwise.)
OPAQUE_TYPES = {
    "",
    "application/octet-stream",
    "application/x-www-form-urlencoded",
    "binary/octet-stream",
}


@dataclass(frozen=True)
class Upload:
    """One uploaded file. name: as declared; declared: what tells its format, or None."""

    content: bytes
    name: str | None
    declared: str | None


async def read_upload(request: Request) -> Upload:
    """The mesh in a request: the multipart field `file`, or a raw body with a media type.

    Raises MalformedFile for a form without that field, UnknownFormat for another media type or
    an encoding.
    """
    encoding = request.headers.get("content-encoding", "identity").lower()
    if encoding != "identity":
        raise UnknownFormat(
            "unknown-encoding", f"content encoding {encoding!r} is not read; send the mesh as it is"
        )
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if media_type == MULTIPART:
        return await _read_form(request)
    if media_type in OPAQUE_TYPES:
        return Upload(await request.body(), None, None)
    for extension, known in FORMATS.items():
        if media_type in known.media_types:
            return Upload(await request.body(), None, extension)
    accepted = ", ".join(known.media_types[0] for known in FORMATS.values())
    raise UnknownFormat(
        "unknown-media-type",
        f"content type {media_type!r} is not one of a mesh; send a form with the field 'file', "
        f"or a raw body as {accepted} or application/octet-stream",
    )


class _FormParser(MultiPartParser):
    """Keeps files in memory: they are bounded, and a service may have no disk to write to."""

    spool_max_size = 0  # no limit


async def _read_form(request: Request) -> Upload:
    try:
        parser = _FormParser(request.headers, request.stream(), max_files=1, max_fields=10)
        form = await parser.parse()
    except MultiPartException as error:
        raise MalformedFile("bad-request", error.message) from None
    file = form.get("file")
    if not isinstance(file, UploadFile):
        raise MalformedFile(
            "no-file-field", "the form has no file in the field 'file': curl -F file=@mesh.obj"
        )
    name = file.filename or ""
    # A name without an extension declares no format: the content decides, as for a path.
    return Upload(file.file.read(), name or None, PurePath(name).suffix or None)
