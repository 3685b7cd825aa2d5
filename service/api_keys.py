"""API keys as an operator gives them."""

from pathlib import Path

from pydantic import SecretStr

# What is shorter can be guessed.
LEAST_CHARACTERS = 16


def check_key(key: SecretStr) -> None:
    """Raises ValueError for a key that a header cannot carry or that is too short."""
    text = key.get_secret_value()
    if len(text) < LEAST_CHARACTERS or not all("!" <= character <= "~" for character in text):
        raise ValueError(
            f"an API key needs {LEAST_CHARACTERS} characters or more, of ASCII without blanks; "
            "make one with: openssl rand -hex 24"
        )


def read_keys(path: Path) -> tuple[SecretStr, ...]:
    """The keys in a file, one in each line. Raises ValueError for a file without any."""
    try:
        lines = path.read_text(encoding="utf-8").split("\n")
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path} is no text") from None
    keys = tuple(SecretStr(line.strip()) for line in lines if line.strip())
    if not keys:
        raise ValueError(f"{path} holds no API key; put one in each line")
    return keys
