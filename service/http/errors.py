"""What can be wrong with a request before anyone looks at its mesh."""

from http import HTTPStatus


class TooLarge(Exception):
    """A request that brings more than is taken. fault: a slug; limit: what it is over."""

    def __init__(self, fault: str, limit: int, message: str) -> None:
        super().__init__(message)
        self.fault = fault
        self.limit = limit


class UploadTooLarge(TooLarge):
    """A request body over the limit, in bytes."""

    def __init__(self, limit: int) -> None:
        super().__init__(
            "body-too-large",
            limit,
            f"the request body is larger than {limit} bytes; simplify the mesh or send a "
            "binary format (STL, PLY, GLB)",
        )


class TooManyMeshes(TooLarge):
    """A request with more meshes than one may bring."""

    def __init__(self, limit: int) -> None:
        super().__init__(
            "too-many-meshes",
            limit,
            f"the request brings more meshes than are taken here, which is {limit}; split it up, "
            "or see /v1/classify/batch",
        )


class UploadTooSlow(Exception):
    """A request whose body was not there by its deadline, in seconds."""

    def __init__(self, seconds: float) -> None:
        super().__init__(f"the request body did not arrive within {seconds:g} s; send it again")


class Unreadable(Exception):
    """Bytes that are no HTTP request. limit: what they are over, if that is what is wrong."""

    def __init__(
        self, message: str, status: HTTPStatus, fault: str, limit: int | None = None
    ) -> None:
        super().__init__(message)
        self.status = status
        self.fault = fault
        self.limit = limit


class BadHead(Unreadable):
    """No request line, or no headers."""

    def __init__(self) -> None:
        super().__init__(
            "what came is no HTTP/1.1 request; where it was meant for TLS, ask the proxy that ends "
            "it in front of this service",
            HTTPStatus.BAD_REQUEST,
            "bad-http",
        )


class BadBody(Unreadable):
    """A body that is not framed as its headers say."""

    def __init__(self) -> None:
        super().__init__(
            "the request body is broken: its chunks are not as HTTP/1.1 has them; send it again",
            HTTPStatus.BAD_REQUEST,
            "bad-http",
        )


class HeadTooLong(Unreadable):
    """Request line and headers over the limit, in bytes."""

    def __init__(self, limit: int) -> None:
        super().__init__(
            f"the request line and headers are longer than {limit} bytes; send fewer headers, and "
            "the mesh as the body",
            HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE,
            "head-too-long",
            limit,
        )


class UpgradeAsked(Unreadable):
    """A request with a body that would rather go on in another protocol.

    The parser takes what follows its head for that protocol, and passes it over.
    """

    def __init__(self) -> None:
        super().__init__(
            "a request with a body cannot change the protocol here; send it as HTTP/1.1, without "
            "the header Upgrade (curl --http1.1)",
            HTTPStatus.BAD_REQUEST,
            "upgrade-with-body",
        )
