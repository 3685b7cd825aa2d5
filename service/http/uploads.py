"""The bytes of an upload, from a multipart form or the raw body."""

from dataclasses import dataclass
from pathlib import PurePath

from fastapi import Request
from starlette.datastructures import FormData, UploadFile
from starlette.formparsers import MultiPartException, MultiPartParser

from meshconv3d.model.errors import MalformedFile, UnknownFormat
from meshconv3d.model.loading import FORMATS
from meshconv3d.service.http.errors import TooManyMeshes

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

    Raises MalformedFile for a form without that field, TooManyMeshes for several, UnknownFormat
    for another media type or an encoding.
    """
    media_type = _media_type(request)
    if media_type == MULTIPART:
        [upload] = _uploads(await _read_form(request, 1))
        return upload
    if media_type in OPAQUE_TYPES:
        return Upload(await read_body(request), None, None)
    for extension, known in FORMATS.items():
        if media_type in known.media_types:
            return Upload(await read_body(request), None, extension)
    accepted = ", ".join(known.media_types[0] for known in FORMATS.values())
    raise UnknownFormat(
        "unknown-media-type",
        f"content type {media_type!r} is not one of a mesh; send a form with the field 'file', "
        f"or a raw body as {accepted} or application/octet-stream",
    )


async def read_body(request: Request) -> bytes:
    """The body of a request as it is. Raises UnknownFormat for an encoding."""
    _refuse_encoding(request)
    return await request.body()


def _media_type(request: Request) -> str:
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


def _refuse_encoding(request: Request) -> None:
    encoding = request.headers.get("content-encoding", "identity").lower()
    if encoding != "identity":
        raise UnknownFormat(
            "unknown-encoding", f"content encoding {encoding!r} is not read; send the mesh as it is"
        )


async def read_uploads(request: Request, most: int) -> list[Upload]:
    """The meshes in a form: every multipart field `file`, in order, up to so many.

    Raises as `read_upload`, and TooManyMeshes.
    """
    if _media_type(request) != MULTIPART:
        raise UnknownFormat(
            "unknown-media-type", "several meshes come as a form with one field 'file' for each"
        )
    return _uploads(await _read_form(request, most))


class _FormParser(MultiPartParser):
    """Keeps files in memory: they are bounded, and a service may have no disk to write to."""

    spool_max_size = 0  # no limit


async def _read_form(request: Request, most: int) -> FormData:
    _refuse_encoding(request)
    try:
        parser = _FormParser(request.headers, request.stream(), max_files=most, max_fields=10)
        return await parser.parse()
    except MultiPartException as error:
        if error.message.startswith("Too many files"):
            raise TooManyMeshes(most) from None
        raise _no_form(error.message.rstrip(".")) from None
    except UnicodeError as error:  # from the charset that the form says it is in
        raise _no_form(str(error)) from None


def _no_form(reason: str) -> MalformedFile:
    return MalformedFile(
        "bad-request",
        f"the form cannot be read: {reason}; send it as 'curl -F file=@mesh.obj' does",
    )


def _uploads(form: FormData) -> list[Upload]:
    files = [field for field in form.getlist("file") if isinstance(field, UploadFile)]
    if not files:
        raise MalformedFile(
            "no-file-field", "the form has no file in the field 'file': curl -F file=@mesh.obj"
        )
    names = [file.filename or "" for file in files]
    # A name without an extension declares no format: the content decides, as for a path.
    return [
        Upload(file.file.read(), name or None, PurePath(name).suffix or None)
        for file, name in zip(files, names, strict=True)
    ]
