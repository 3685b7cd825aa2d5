"""The committed page is what its source makes."""

import gzip
import os
import shutil
import subprocess
from pathlib import Path

import pytest

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
    if shutil.which("node") is None:
        pytest.skip("needs node")
    if not (SOURCE / "node_modules").is_dir():
        reason = "needs the page's packages: npm ci --prefix page"
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)
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
