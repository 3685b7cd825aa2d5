"""Headers that every answer carries, so that no browser makes more of it than it is.

Strict-Transport-Security is not among them: who ends TLS in front of the service says that.
"""

# An answer of the API is data: it loads nothing, and stands in nobody's frame.
SECURITY_HEADERS: list[tuple[str, str]] = [
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("content-security-policy", "default-src 'none'; frame-ancestors 'none'"),
]
