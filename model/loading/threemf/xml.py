"""XML that is read as it comes: no tree, no document type, no entities of its own."""

from collections.abc import Callable, Iterable
from xml.parsers import expat

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.jit import kernel
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.text import LOWER, NINE, ZERO, is_space, number, quoted

Attributes = dict[str, str]

SEPARATOR = "}"  # between the namespace and the name of an element or attribute

_ENCODINGS = frozenset({"utf-8", "utf-16", "us-ascii", "iso-8859-1"})
_DEEPEST = 1000
_DISTINCT_NAMES = 10_000
_NAMESPACE_LENGTH = 250  # characters, which each name in the namespace repeats
_ORDINARY_ATTRIBUTES = 8  # of a vertex or triangle
_OUT_OF_MEMORY = expat.errors.codes[expat.errors.XML_ERROR_NO_MEMORY]

SPACE, SLASH, GREATER, LESS, EQUALS, AMPERSAND, QUOTE, APOSTROPHE = b" /><=&\"'"
LETTER_A, LETTER_X, LETTER_Z, UNDERSCORE = b"axz_"
MOST_DIGITS = 15  # of a whole number that a float64 holds


class Parser:
    """Calls `on_element` for the start of every element, in the order of the text.

    name: of the text, for messages.
    on_element: each element and attribute counts as one of the limit `values`, unless it returns
        True, for what another limit counts.
    on_namespace: called for each prefix that is bound to a namespace, before its element.
    on_end: called for the end of each element, with the text after the latest start or end.
    """

    def __init__(
        self,
        name: str,
        on_element: Callable[[str, Attributes], object],
        limits: Limits,
        on_namespace: Callable[[str | None, str], object] = lambda *_: None,
        on_end: Callable[[str, str], object] | None = None,
    ) -> None:
        self._name = name
        self._on_element = on_element
        self._on_namespace = on_namespace
        self._on_end = on_end
        self._text: list[str] = []
        self._limits = limits
        self._depth = self._values = self._given = 0
        self.started = -1  # where the latest element began, in bytes of what was given
        self._names: dict[str, str] = {}  # expat remembers every name that it has met
        self._expat = expat.ParserCreate(namespace_separator=SEPARATOR, intern=self._names)
        self._expat.StartElementHandler = self._start
        self._expat.EndElementHandler = self._end
        self._expat.StartNamespaceDeclHandler = self._namespace
        if on_end is not None:
            self._expat.buffer_text = True
            self._expat.CharacterDataHandler = self._text.append
        self._expat.XmlDeclHandler = _check_declaration
        self._expat.StartDoctypeDeclHandler = _refuse_document_type

    def read(self, blocks: Iterable[bytes]) -> None:
        """Read a whole text. Raises MalformedFile and LimitExceeded."""
        for block in blocks:
            self.feed(block)
        self.feed(b"", last=True)

    def feed(self, block: bytes, last: bool = False) -> int:
        """Read on. Returns where the block began. Raises as `read`."""
        began = self._given
        self._given += len(block)
        try:
            self._expat.Parse(block, last)
        except expat.ExpatError as error:
            if error.code == _OUT_OF_MEMORY:
                raise MemoryError from error
            raise self._malformed(str(error)) from error
        except KeyError as error:
            raise self._malformed(f"an element has no attribute {quoted(error.args[0])}") from error
        if not last:
            self.check_tag(self._given - self._expat.CurrentByteIndex)
        if len(self._names) > _DISTINCT_NAMES:
            raise self._malformed(f"it has more than {_DISTINCT_NAMES} different names")
        return began

    def check_tag(self, length: int) -> None:
        """Raises LimitExceeded for a tag that is longer than the limit and has not ended."""
        found = f"the XML of {quoted(self._name)} has a tag of {length} bytes"
        self._limits.check("tag_bytes", length, found)

    def _start(self, element: str, attributes: Attributes) -> None:
        self._depth += 1
        if self._depth > _DEEPEST:  # expat remembers every element that is open
            raise self._malformed(f"elements are nested more than {_DEEPEST} deep")
        self.started = self._expat.CurrentByteIndex
        self._text.clear()
        count = len(attributes)
        if not self._on_element(element, attributes) or count > _ORDINARY_ATTRIBUTES:
            self._values += 1 + count
            self._limits.check("values", self._values)

    def _end(self, element: str) -> None:
        self._depth -= 1
        if self._on_end is not None:
            self._on_end(element, "".join(self._text))
            self._text.clear()

    def _namespace(self, prefix: str | None, uri: str | None) -> None:
        self._values += 1
        self._limits.check("values", self._values)
        if uri is not None and len(uri) > _NAMESPACE_LENGTH:
            raise self._malformed(f"a namespace has more than {_NAMESPACE_LENGTH} characters")
        self._on_namespace(prefix, uri or "")

    def _malformed(self, why: str) -> MalformedFile:
        message = f"the XML of {quoted(self._name)} makes no sense: {why}"
        return MalformedFile("bad-document", message)


def _check_declaration(_version: str, encoding: str | None, _standalone: int) -> None:
    # Others would be looked up in Python's own files.
    if encoding is not None and encoding.lower() not in _ENCODINGS:
        raise MalformedFile(
            "unsupported-feature", f"XML in the encoding {quoted(encoding)} is not read, use UTF-8"
        )


def _refuse_document_type(*_: object) -> None:
    raise MalformedFile("bad-header", "a part of the package has a DTD, which 3MF forbids")


@kernel
def scan_elements(text, plain, place, tag, names, whole, rows):
    """Read elements as <TAG a="1" b="2" c="3"/>, whatever attributes are beside these.

    It takes what the parser takes, except that it does not look for attributes that come twice.

    text: ends in white space; plain: the same with spaces in place of quotes; names: of the three
    attributes; whole: whether they are whole numbers; rows: room for N x 3 of them.

    Returns the count of elements, and the place after them.
    """
    count = 0
    while count < len(rows):
        start = place
        while place < len(text) and is_space(text[place]):
            place += 1
        if place + len(tag) >= len(text):
            return count, start
        for character in tag:
            if text[place] != character:
                return count, start
            place += 1
        found = 0
        while True:
            if not is_space(text[place]) and text[place] != SLASH:
                return count, start
            while place < len(text) and is_space(text[place]):
                place += 1
            if place == len(text):
                return count, start
            if text[place] == SLASH:
                break
            place, attribute = _attribute(text, plain, place, names, whole, rows[count])
            if place < 0 or found & attribute:
                return count, start
            found |= attribute
        if found != 7 or text[place + 1] != GREATER:
            return count, start
        place += 2
        count += 1
    return count, place


@kernel
def _attribute(text, plain, place, names, whole, row):
    """Read an attribute. Returns the place after it, or -1, and 1, 2 or 4 for one of the three
    names, whose number is set in the row."""
    first = place
    while (
        LETTER_A <= text[place] | LOWER <= LETTER_Z
        or (place > first and ZERO <= text[place] <= NINE)
        or text[place] == UNDERSCORE
    ):
        place += 1
    size = place - first
    if size == 0 or text[place] != EQUALS:
        return -1, 0
    quote = text[place + 1]
    if quote != QUOTE and quote != APOSTROPHE:
        return -1, 0
    if size > 3 and text[first] == LETTER_X:  # maybe xmlns, which is for the parser
        return -1, 0
    place += 2
    for column in range(3):
        ends = text[first + 1] if size == 2 else EQUALS
        if size <= 2 and text[first] == names[column, 0] and ends == names[column, 1]:
            start = place
            if whole:
                value = 0.0
                while ZERO <= text[place] <= NINE and place - start < MOST_DIGITS:
                    value = 10 * value + (text[place] - ZERO)
                    place += 1
            else:
                value, place = number(plain, place)
            if place == start or value != value or text[place] != quote:
                return -1, 0
            row[column] = value
            return place + 1, 1 << column
    while text[place] != quote:
        if not SPACE <= text[place] < 128 or text[place] == LESS or text[place] == AMPERSAND:
            return -1, 0
        place += 1
    return place + 1, 0
