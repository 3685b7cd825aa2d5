"""Reads the bytes of an upload from a multipart form or a raw body, as they arrive.

No step costs the event loop more than the chunk that has just arrived, and no byte is held twice.
"""

import asyncio
import io
import re
import sys
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import PurePath
from urllib.parse import unquote_to_bytes

from fastapi import Request
from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header

from meshconv3d.model.errors import LimitExceeded, MalformedFile, MeshError
from meshconv3d.model.loading import (
    FORMATS,
    Limits,
    MeshArchive,
    find_pieces,
    has_mesh_name,
    is_archive,
)
from meshconv3d.service.http.admission import admitted, declared_length
from meshconv3d.service.http.context import context_of
from meshconv3d.service.http.problems import RequestError
from meshconv3d.service.settings import Settings

MULTIPART = "multipart/form-data"
# Media types that say nothing about the format: the name, if any, and the content decide.
# (curl --data-binary declares a form unless told otherwise.)
OPAQUE_TYPES = {
    "",
    "application/octet-stream",
    "application/x-www-form-urlencoded",
    "binary/octet-stream",
}
# Parts of a form beside its files, which are ignored.
MAX_OTHER_PARTS = 10
# Longest header of a part: a name of 255 bytes has 765 in percent encoding.
MAX_HEADER_BYTES = 2048
# Parameters of one such header.
MAX_PARAMETERS = 16
# Bytes of a form that are parsed in one turn of the event loop.
PIECE_BYTES = 16 * 1024
# Files of a form beside its meshes: buffers, pictures, materials.
MAX_PIECES = 100
# Files that one of its meshes may name, pictures included.
MAX_NAMES = 1000
LIMITS = Limits()  # of archives
# Longest boundary of a form (RFC 2046, 5.1.1).
MAX_BOUNDARY = 70
UTF8 = {b"utf-8", b"utf8"}

# The name as RFC 5987 writes it: filename*=UTF-8''l%C3%A4mp.obj
_EXTENDED_NAME = re.compile(rb";\s*filename\*\s*=\s*([^;\s]*)", re.IGNORECASE)


@dataclass(frozen=True)
class Upload:
    """One uploaded file. name: as declared; declared: the format it is declared as, or None.
    pieces: the other files that it may refer to, by their names. error: why it cannot be read."""

    content: bytes
    name: str | None
    declared: str | None
    pieces: Mapping[str, bytes] = field(default_factory=dict)
    error: MeshError | None = None

    @property
    def size(self) -> int:
        """Bytes of the file and of its pieces."""
        return len(self.content) + sum(map(len, self.pieces.values()))


class BodyReader:
    """Reads a request body piece by piece, within its limits.

    Raises RequestError where it is encoded, too large, too slow, or finds no room.
    """

    def __init__(self, request: Request, settings: Settings) -> None:
        self._request = request
        self._settings = settings
        self._chunks = self._read_chunks()
        self._rest = memoryview(b"")

    async def pieces(self) -> AsyncIterator[bytes]:
        """The body as it arrives, in pieces so small that each can be parsed in a few ms."""
        async for chunk in self._chunks:
            for start in range(0, len(chunk), PIECE_BYTES):
                if start:
                    await asyncio.sleep(0)
                yield chunk[start : start + PIECE_BYTES]

    async def read(self, count: int) -> bytes:
        """The next `count` bytes, or all that is left where that is less."""
        content = io.BytesIO()  # hands its bytes over without a copy
        while count > 0:
            if not self._rest:
                chunk = await anext(self._chunks, None)
                if chunk is None:
                    break
                self._rest = memoryview(chunk)
            content.write(self._rest[:count])
            taken = min(count, len(self._rest))
            self._rest, count = self._rest[taken:], count - taken
        return content.getvalue()

    async def _read_chunks(self) -> AsyncIterator[bytes]:
        encoding = self._request.headers.get("content-encoding", "identity").lower()
        if encoding != "identity":
            detail = f"content encoding {encoding!r} is not read; send the mesh as it is"
            raise RequestError(415, "unknown-encoding", detail)
        limit, seconds = self._settings.max_upload_bytes, self._settings.deadline_seconds
        share, context = admitted(self._request), context_of(self._request)
        stream = self._request.stream()
        came, began = declared_length(self._request.scope), time.monotonic()
        while came <= limit:
            try:
                async with asyncio.timeout(share.expires - time.monotonic()):
                    chunk = await anext(stream, None)
            except TimeoutError:
                detail = f"the request body did not arrive within {seconds:g} s; send it again"
                close = {"connection": "close"}
                raise RequestError(408, "upload-too-slow", detail, headers=close) from None
            if chunk is None:
                share.enter(1)
                context.stages.append(("upload", time.monotonic() - began))
                return
            share.hold(len(chunk))
            context.received += len(chunk)
            came = max(came, context.received)
            yield chunk
        detail = (
            f"the request body is larger than {limit} bytes; simplify the mesh or send a binary "
            "format (STL, PLY, GLB)"
        )
        raise RequestError(413, "body-too-large", detail, limit)


async def read_upload(request: Request, settings: Settings) -> Upload:
    """The mesh of a request: the form field `file`, or a raw body with a media type.

    A form may bring other files than meshes with it: buffers of a .gltf, or what is ignored, such
    as pictures.

    Raises RequestError: 400 for a form without that field, 413 for several files, 415 for another
    media type or a form that is not UTF-8.
    """
    media_type = _media_type(request)
    if media_type == MULTIPART:
        uploads = await _read_form(request, settings, 1)
        meshes = [upload for upload in uploads if has_mesh_name(upload.name or "")] or uploads
        if len(meshes) > 1:
            raise too_many_meshes(1)
        if len(uploads) == 1:
            return uploads[0]
        upload = await asyncio.to_thread(_with_pieces, meshes[0], _Beside(uploads).of(meshes[0]))
        if upload.error is not None:
            raise upload.error
        return upload
    extensions = [name for name, known in FORMATS.items() if media_type in known.media_types]
    if not extensions and media_type not in OPAQUE_TYPES:
        accepted = ", ".join(known.media_types[0] for known in FORMATS.values())
        detail = (
            f"content type {media_type!r} is not one of a mesh; send a form with the field 'file', "
            f"or a raw body as {accepted} or application/octet-stream"
        )
        raise RequestError(415, "unknown-media-type", detail)
    content = await BodyReader(request, settings).read(sys.maxsize)
    return Upload(content, None, extensions[0] if extensions else None)


async def read_uploads(request: Request, settings: Settings) -> list[Upload]:
    """The meshes of a form: every field `file`, in order. Raises as `read_upload`.

    Buffers of a .gltf are given to it, and each mesh in a ZIP archive is one of its own.
    """
    if _media_type(request) != MULTIPART:
        detail = "several meshes come as a form with one field 'file' for each"
        raise RequestError(415, "unknown-media-type", detail)
    most, room = settings.max_request_meshes, settings.max_upload_bytes
    uploads = await _read_form(request, settings, most)
    uploads = await asyncio.to_thread(_expanded, uploads, most, room)
    admitted(request).reserve(sum(upload.size for upload in uploads))
    return uploads


def _expanded(uploads: Sequence[Upload], most: int, total: int) -> list[Upload]:
    """The meshes among uploads: with their pieces, and out of ZIP archives.

    most: meshes; total: bytes that archives may unpack to together. An archive that holds more than
    is left of either is one mesh with that error. Raises RequestError for more than `most` files.
    """
    beside = _Beside(uploads)
    complete = [_with_pieces(upload, beside.of(upload)) for upload in uploads]
    files = [
        upload
        for number, upload in enumerate(complete)
        if has_mesh_name(upload.name or "") or number not in beside.taken
    ]
    if len(files) > most:
        raise too_many_meshes(most)
    places, room = most - len(files), total
    meshes: list[Upload] = []
    for upload in files:
        try:
            found = _unpacked(upload, places + 1, room)
        except MeshError as error:
            found = [_refused(upload, error)]
        places -= len(found) - 1
        room -= sum(mesh.size for mesh in found if mesh is not upload)
        meshes += found
    return meshes


def _unpacked(upload: Upload, most: int, room: int) -> list[Upload]:
    """The meshes in an upload that is a ZIP archive; another one as it is.

    most: meshes; room: bytes that they and their pieces may unpack to. Raises MeshError.
    """
    if not is_archive(upload.content, upload.declared):
        return [upload]
    bounds = replace(LIMITS, unpacked_bytes=room, piece_bytes=room)
    archive = MeshArchive(upload.content, bounds)
    archive.check_any()
    if len(archive.names) > most:
        raise LimitExceeded("meshes", most, f"the archive holds {len(archive.names)} meshes")
    meshes: list[Upload] = []
    declared = sum(map(archive.size, archive.names))
    for name in archive.names:
        mesh = Upload(b"", f"{upload.name or ''}/{name}", PurePath(name).suffix)
        try:
            mesh = replace(mesh, content=archive.read(name))
            meshes.append(_with_pieces(mesh, partial(archive.pieces, name)))
        except MeshError as error:
            meshes.append(_refused(mesh, error))
        size = max(declared, sum(mesh.size for mesh in meshes))
        if size > room:
            raise LimitExceeded("unpacked_bytes", room, f"the archive unpacks to {size} bytes")
    return meshes


def _with_pieces(upload: Upload, find: Callable[[bytes], dict[str, bytes]]) -> Upload:
    try:
        return replace(upload, pieces=find(upload.content))
    except MeshError as error:
        return _refused(upload, error)


def _refused(upload: Upload, error: MeshError) -> Upload:
    error.__traceback__ = error.__cause__ = error.__context__ = None  # they hold the archive
    return replace(upload, error=error)


class _Beside:
    """The files of a form, as the pieces of its meshes. taken: places of those that are pieces."""

    def __init__(self, uploads: Sequence[Upload]) -> None:
        self.taken: set[int] = set()
        self._uploads = uploads
        self._places: dict[PurePath, list[int]] = {}
        for place, upload in enumerate(uploads):
            path = PurePath(upload.name or "")
            for name in {path, PurePath(path.name)}:
                self._places.setdefault(name, []).append(place)

    def of(self, mesh: Upload) -> Callable[[bytes], dict[str, bytes]]:
        """Finds the pieces of a mesh, given its content."""
        read = partial(self._read, PurePath(mesh.name or "").parent)
        return partial(find_pieces, read=read, limits=replace(LIMITS, entries=MAX_NAMES))

    def _read(self, folder: PurePath, piece: str) -> bytes | None:
        """The file at a path relative to a mesh, or else one of its name in any folder, since
        forms may name none. Raises MalformedFile where several have that name."""
        name = PurePath(piece).name
        places = self._places.get(folder / piece) or self._places.get(PurePath(name), [])
        contents = {self._uploads[place].content for place in places}
        if len(contents) > 1:
            raise MalformedFile(
                "external-reference",
                f"the form has several files named {name!r}; send each mesh with its files in a "
                "form or a ZIP archive of its own",
            )
        self.taken |= set(places)
        return next(iter(contents), None)


def too_many_meshes(limit: int) -> RequestError:
    """The error for a request with more meshes than one may bring."""
    detail = (
        f"the request brings more meshes than are taken here, which is {limit}; split it up, or "
        "see /v1/classify/batch"
    )
    return RequestError(413, "too-many-meshes", detail, limit)


def _media_type(request: Request) -> str:
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


async def _read_form(request: Request, settings: Settings, most: int) -> list[Upload]:
    """The files in the fields `file` of a form, of which `most` may be meshes; at least one."""
    options = _options(request.headers["content-type"].encode("latin-1"), "the content type")
    _check_charset(options.get(b"charset", b"utf-8"))
    boundary = options.get(b"boundary", b"")
    if not 0 < len(boundary) <= MAX_BOUNDARY:
        raise _bad_form(f"its content type names no boundary of 1 to {MAX_BOUNDARY} characters")
    form = _Form(boundary, most)
    try:
        async for piece in BodyReader(request, settings).pieces():
            form.parser.write(piece)
    except FormParserError as error:
        raise _bad_form(str(error)) from None
    if not form.complete:
        raise _bad_form("it is cut off before its last boundary")
    if not form.files:
        detail = "the form has no file in the field 'file': curl -F file=@mesh.obj"
        raise RequestError(400, "no-file-field", detail)
    # A name without an extension declares no format: the content decides, as for a path.
    return [
        Upload(content.getvalue(), name or None, PurePath(name).suffix or None)
        for name, content in form.files
    ]


class _Form:
    """The files of a form, as its parser reports them. parser: raises RequestError, too."""

    def __init__(self, boundary: bytes, most: int) -> None:
        """most: meshes, beside their pieces."""
        self.files: list[tuple[str, io.BytesIO]] = []
        self.complete = False
        self._most = most
        self._others = 0
        self._field, self._value, self._disposition = b"", b"", b""
        self._content: io.BytesIO | None = None
        self.parser = MultipartParser(
            boundary,
            {
                "on_part_begin": self._begin_part,
                "on_header_field": self._add_to_field,
                "on_header_value": self._add_to_value,
                "on_header_end": self._end_header,
                "on_headers_finished": self._end_headers,
                "on_part_data": self._add_content,
                "on_end": self._end,
            },
            max_header_size=MAX_HEADER_BYTES,
        )

    def _begin_part(self) -> None:
        self._disposition = b""

    def _add_to_field(self, data: bytes, start: int, end: int) -> None:
        self._field += data[start:end]

    def _add_to_value(self, data: bytes, start: int, end: int) -> None:
        self._value += data[start:end]

    def _end_header(self) -> None:
        if self._field.lower() == b"content-disposition":
            self._disposition = self._value
        self._field, self._value = b"", b""

    def _end_headers(self) -> None:
        options = _options(self._disposition, "the disposition of a part")
        name = _extended_name(self._disposition)
        if name is None and b"filename" in options:
            name = options[b"filename"].decode(errors="replace")
        self._content = None
        if name is not None and options.get(b"name") == b"file":
            self._content = io.BytesIO()
            self.files.append((name, self._content))
        else:
            self._others += 1
        if len(self.files) > self._most + MAX_PIECES:
            raise too_many_meshes(self._most)
        if self._others > MAX_OTHER_PARTS:
            raise _bad_form(f"it has more than {MAX_OTHER_PARTS} other fields")

    def _add_content(self, data: bytes, start: int, end: int) -> None:
        if self._content is not None:
            self._content.write(data[start:end])

    def _end(self) -> None:
        self.complete = True


def _options(header: bytes, what: str) -> dict[bytes, bytes]:
    """The parameters of a header."""
    if header.count(b";") > MAX_PARAMETERS:
        raise _bad_form(f"{what} has more than {MAX_PARAMETERS} parameters")
    return parse_options_header(header)[1]


def _extended_name(disposition: bytes) -> str | None:
    """The name of a file as RFC 5987 writes it, or None.

    What is not UTF-8 in it becomes a replacement character.
    """
    unquoted = b"".join(disposition.split(b'"')[::2])
    found = _EXTENDED_NAME.search(unquoted)
    if found is None:
        return None
    charset, *_, encoded = found[1].split(b"'")
    _check_charset(charset)
    return unquote_to_bytes(encoded).decode(errors="replace")


def _check_charset(charset: bytes) -> None:
    if charset.lower() not in UTF8:
        detail = "the form names a charset other than UTF-8; send it as UTF-8"
        raise RequestError(415, "unknown-charset", detail)


def _bad_form(reason: str) -> RequestError:
    detail = f"the form cannot be read: {reason}; send it as 'curl -F file=@mesh.obj' does"
    return RequestError(400, "bad-request", detail)
