"""XML that is read as it comes: no tree, no document type, no entities of its own."""

from collections.abc import Callable, Iterable
from xml.parsers import expat

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.text import quoted

Attributes = dict[str, str]

SEPARATOR = "}"  # between the namespace and the name of an element or attribute

_ENCODINGS = frozenset({"utf-8", "utf-16", "us-ascii", "iso-8859-1"})
_DEEPEST = 1000
_DISTINCT_NAMES = 10_000
_OUT_OF_MEMORY = expat.errors.codes[expat.errors.XML_ERROR_NO_MEMORY]


def read_xml(
    blocks: Iterable[bytes],
    name: str,
    on_element: Callable[[str, Attributes], None],
    on_namespace: Callable[[str | None, str], None],
    limits: Limits,
) -> None:
    """Calls `on_element` for the start of every element, in the order of the text.

    name: of the text, for messages.
    on_namespace: called for each prefix that is bound to a namespace, before its element.

    Raises MalformedFile and LimitExceeded.
    """
    depth = 0

    def start(element: str, attributes: Attributes) -> None:
        nonlocal depth
        depth += 1
        if depth > _DEEPEST:  # expat remembers every element that is open
            raise _malformed(name, f"elements are nested more than {_DEEPEST} deep")
        on_element(element, attributes)

    def end(_: str) -> None:
        nonlocal depth
        depth -= 1

    names: dict[str, str] = {}  # expat remembers every name that it has met
    parser = expat.ParserCreate(namespace_separator=SEPARATOR, intern=names)
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartNamespaceDeclHandler = on_namespace
    parser.XmlDeclHandler = _check_declaration
    parser.StartDoctypeDeclHandler = _refuse_document_type
    given = 0
    try:
        for block in blocks:
            parser.Parse(block, False)
            tag = given - parser.CurrentByteIndex  # what no block has ended yet
            given += len(block)
            limits.check("line_bytes", tag, f"the XML of {quoted(name)} has a tag of {tag} bytes")
            if len(names) > _DISTINCT_NAMES:
                raise _malformed(name, f"it has more than {_DISTINCT_NAMES} different names")
        parser.Parse(b"", True)
    except expat.ExpatError as error:
        if error.code == _OUT_OF_MEMORY:
            raise MemoryError from error
        raise _malformed(name, str(error)) from error
    except KeyError as error:
        raise _malformed(name, f"an element has no attribute {quoted(error.args[0])}") from error


def _check_declaration(_version: str, encoding: str | None, _standalone: int) -> None:
    # Others would be looked up in Python's own files.
    if encoding is not None and encoding.lower() not in _ENCODINGS:
        raise MalformedFile(
            "unsupported-feature", f"XML in the encoding {quoted(encoding)} is not read, use UTF-8"
        )


def _refuse_document_type(*_: object) -> None:
    raise MalformedFile("bad-header", "a part of the package has a DTD, which 3MF forbids")


def _malformed(name: str, why: str) -> MalformedFile:
    return MalformedFile("bad-document", f"the XML of {quoted(name)} makes no sense: {why}")
