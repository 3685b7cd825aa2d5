"""POST /v1/classify on a running service: every way to send a mesh, one record."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest

from meshconv3d.model.loading import FORMATS
from tests.articulated import sample_paths
from tests.commands import meshconv3d


def result_of(response: httpx.Response) -> dict:
    """An answer without what differs between calls: timings, and the name as sent."""
    assert response.status_code == 200, response.text
    assert response.headers["content-type"] == "application/json"
    assert response.headers["x-request-id"]
    return {key: value for key, value in response.json().items() if key not in VARYING}


VARYING = {"file", "timings_ms"}


def test_the_record_is_that_of_the_command_line(client: httpx.Client, model_file: Path) -> None:
    paths = sample_paths().values()
    done = meshconv3d("classify", *paths, "--model", model_file)
    for path, line in zip(paths, done.stdout.splitlines(), strict=True):
        with path.open("rb") as file:
            response = client.post("/v1/classify", files={"file": (path.name, file)})
        expected = json.loads(line)
        assert list(response.json()) == list(expected)
        assert response.json()["file"] == path.name
        assert set(response.json()["timings_ms"]) == set(expected["timings_ms"])
        expected = {key: value for key, value in expected.items() if key not in VARYING}
        assert result_of(response) == expected


def test_every_media_type_of_every_format(client: httpx.Client) -> None:
    samples = {path.suffix[1:]: path.read_bytes() for path in sample_paths().values()}
    assert {"obj", "stl", "ply", "off", "glb", "3mf"} <= set(samples)
    for extension, content in samples.items():
        form = client.post("/v1/classify", files={"file": (f"mesh.{extension}", content)})
        for media_type in (*FORMATS[extension].media_types, "application/octet-stream"):
            raw = client.post("/v1/classify", content=content, headers={"content-type": media_type})
            assert result_of(raw) == result_of(form), media_type
            assert raw.json()["file"] is None


@pytest.mark.parametrize("header", [{}, {"content-type": "Model/OBJ; charset=utf-8"}])
def test_headers_as_clients_write_them(
    client: httpx.Client, meshes: Path, header: dict[str, str]
) -> None:
    content = (meshes / "ring.obj").read_bytes()
    assert result_of(client.post("/v1/classify", content=content, headers=header))


@pytest.mark.parametrize("name", ["ring.obj", "RING.OBJ", "ring", "-", "a/b c/ü.obj"])
def test_names_of_uploads(client: httpx.Client, meshes: Path, name: str) -> None:
    """A name without an extension leaves the format to the content."""
    content = (meshes / "ring.obj").read_bytes()
    response = client.post("/v1/classify", files={"file": (name, content)})
    assert result_of(response)["mesh"]["faces_in"] == 500
    assert response.json()["file"] == name


@pytest.mark.parametrize(
    ("parameters", "name"),
    [
        ("filename*=UTF-8''l%C3%A4mp.obj", "lämp.obj"),
        ("filename=\"lamp.obj\"; filename*=utf-8'de'l%c3%a4mp.obj", "lämp.obj"),
        ("filename*=UTF-8''%ED%A0%80.obj", "\ufffd\ufffd\ufffd.obj"),
        ('filename="\udced\udca0\udc80.obj"', "\ufffd\ufffd\ufffd.obj"),
        ('filename="l\udce4mp.obj"', "l\ufffdmp.obj"),
        ("filename=\"x; filename*=UTF-8''y.obj\"", "x; filename*=UTF-8''y.obj"),
    ],
)
@pytest.mark.parametrize("batch", [False, True])
def test_names_as_forms_write_them(
    client: httpx.Client, meshes: Path, parameters: str, name: str, batch: bool
) -> None:
    """What is not UTF-8 in a name becomes replacement characters; no answer is lost for it."""
    head = f'--b\r\nContent-Disposition: form-data; name="file"; {parameters}\r\n\r\n'
    content = head.encode(errors="surrogateescape") + (meshes / "ring.obj").read_bytes()
    response = client.post(
        "/v1/classify/batch" if batch else "/v1/classify",
        content=content + b"\r\n--b--\r\n",
        headers={"content-type": "multipart/form-data; boundary=b; charset=UTF-8"},
    )
    assert response.status_code == 200, response.text
    assert response.json()["file"] == name


def test_a_name_in_another_charset_is_refused(client: httpx.Client) -> None:
    part = b"--b\r\nContent-Disposition: form-data; name=file; filename*=utf-7''a\r\n\r\nv\r\n--b--"
    headers = {"content-type": "multipart/form-data; boundary=b"}
    response = client.post("/v1/classify", content=part, headers=headers)
    assert (response.status_code, response.json()["fault"]) == (415, "unknown-charset")


def test_a_form_that_is_cut_off_is_told_as_that(client: httpx.Client, meshes: Path) -> None:
    head = b'--b\r\nContent-Disposition: form-data; name="file"; filename="a.obj"\r\n\r\n'
    headers = {"content-type": "multipart/form-data; boundary=b"}
    content = head + (meshes / "ring.obj").read_bytes()[:9000]
    response = client.post("/v1/classify", content=content, headers=headers)
    assert response.status_code == 400
    assert "cut off" in response.json()["detail"]


def test_other_fields_of_a_form_are_ignored(client: httpx.Client, meshes: Path) -> None:
    content = (meshes / "ring.obj").read_bytes()
    form = {"files": {"file": ("ring.obj", content)}, "data": {"note": "mine"}}
    assert result_of(client.post("/v1/classify", **form))


@pytest.mark.parametrize(("top", "count"), [(1, 1), (2, 2), (100, 3)])
def test_top(client: httpx.Client, meshes: Path, top: int, count: int) -> None:
    content = (meshes / "ring.obj").read_bytes()
    scores = client.post("/v1/classify", content=content).json()["scores"]
    response = client.post("/v1/classify", content=content, params={"top": top})
    assert response.json()["scores"] == scores[:count]


def test_many_clients_at_once(client: httpx.Client) -> None:
    contents = [path.read_bytes() for path in sample_paths().values()]

    def ask(content: bytes) -> dict:
        return result_of(client.post("/v1/classify", content=content))

    alone = [ask(content) for content in contents]
    assert len({record["probability"] for record in alone}) == len(alone)
    with ThreadPoolExecutor(12) as pool:
        assert list(pool.map(ask, contents * 4)) == alone * 4


def test_the_stages_are_told_to_browsers(client: httpx.Client, meshes: Path) -> None:
    answer = client.post("/v1/classify", content=(meshes / "ring.obj").read_bytes())
    timing = dict(part.split(";dur=") for part in answer.headers["server-timing"].split(", "))
    assert set(timing) == {"upload", "queue", *answer.json()["timings_ms"]}
    for stage, milliseconds in answer.json()["timings_ms"].items():
        assert float(timing[stage]) == pytest.approx(milliseconds, abs=0.06)
