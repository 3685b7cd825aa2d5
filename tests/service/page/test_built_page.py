"""The committed page is what its source makes."""

import gzip
import subprocess
from pathlib import Path

from tests.service.page.conftest import require_page_packages

ROOT = Path(__file__).parents[3]
SOURCE, BUILT = ROOT / "page", ROOT / "service" / "page"


def files(folder: Path) -> dict[str, bytes]:
    """The content of each file; unpacked, since versions of zlib pack differently."""
    contents = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            content = path.read_bytes()
            packed = path.suffix == ".bin"
            contents[str(path.relative_to(folder))] = (
                gzip.decompress(content) if packed else content
            )
    return contents


def test_a_build_gives_the_committed_files(tmp_path: Path) -> None:
    require_page_packages(SOURCE)
    done = subprocess.run(
        ["npm", "run", "build", "--", "--outDir", str(tmp_path / "built")],
        cwd=SOURCE,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    built, committed = files(tmp_path / "built"), files(BUILT)
    assert list(built) == list(committed), "the page has changed: npm run build --prefix page"
    assert [name for name in built if built[name] != committed[name]] == []
