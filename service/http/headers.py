"""Headers that every answer carries, so that no browser makes more of it than it is.

Strict-Transport-Security is not among them: who ends TLS in front of the service says that.
"""

SECURITY_HEADERS: list[tuple[str, str]] = [
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
]

# An answer of the API is data: it loads nothing, and stands in nobody's frame. Browsers obey all
# policies that an answer carries, so that only what has none of its own, as the page has, gets it.
DATA_POLICY = (b"content-security-policy", b"default-src 'none'; frame-ancestors 'none'")
