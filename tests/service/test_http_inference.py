"""The inference protocol, spoken by the client of those who defined it."""

import base64
import json
import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest
import tritonclient.http as triton
from tritonclient.utils import InferenceServerException

from tests.articulated import sample_paths
from tests.service.conftest import Service

MODEL = "tiny"
HTTP = Path(__file__).parents[2] / "docs" / "http.md"
NAMES = ["ants", "hand", "octopus", "pliers"]


@pytest.fixture(scope="module")
def protocol(service: Service) -> Iterator[triton.InferenceServerClient]:
    with triton.InferenceServerClient(service.url.removeprefix("http://")) as client:
        yield client


def tensor(name: str, elements: list[bytes], binary: bool = True) -> triton.InferInput:
    made = triton.InferInput(name, [len(elements)], "BYTES")
    made.set_data_from_numpy(np.array(elements, np.object_), binary_data=binary)
    return made


def values(result: triton.InferResult, name: str) -> np.ndarray:
    found = result.as_numpy(name)
    assert found is not None
    return found


def samples() -> list[bytes]:
    return [sample_paths()[name].read_bytes() for name in NAMES]


def test_health_and_metadata(protocol: triton.InferenceServerClient) -> None:
    assert protocol.is_server_live()
    assert protocol.is_server_ready()
    assert protocol.is_model_ready(MODEL)
    assert not protocol.is_model_ready("other")
    assert protocol.get_server_metadata()["extensions"] == ["binary_tensor_data"]


def test_scores_are_those_of_the_records(
    protocol: triton.InferenceServerClient, client: httpx.Client
) -> None:
    """They are rounded in the records, and sorted."""
    result = protocol.infer(MODEL, [tensor("mesh", samples())])
    classes = [name.decode() for name in values(result, "classes")]
    assert classes == client.get("/v1/models/tiny").json()["config"]["classes"]
    for i, content in enumerate(samples()):
        record = client.post("/v1/classify", content=content).json()
        assert values(result, "class")[i].decode() == record["class"]
        assert values(result, "unknown")[i] == record["unknown"]
        for score in record["scores"]:
            place = i, classes.index(score["class"])
            assert values(result, "scores")[place] == pytest.approx(score["score"], abs=1e-4)
            probability = values(result, "probabilities")[place]
            assert probability == pytest.approx(score["probability"], abs=1e-5)


def test_answers_have_the_tensors_that_the_metadata_promises(
    protocol: triton.InferenceServerClient,
) -> None:
    metadata = protocol.get_model_metadata(MODEL)
    assert [entry["name"] for entry in metadata["inputs"]] == ["mesh", "name"]
    response = protocol.infer(MODEL, [tensor("mesh", samples())]).get_response()
    for promised, given in zip(metadata["outputs"], response["outputs"], strict=True):
        assert (promised["name"], promised["datatype"]) == (given["name"], given["datatype"])
        assert [n if n > 0 else len(NAMES) for n in promised["shape"]] == given["shape"]


def test_json_and_binary_data_say_the_same(protocol: triton.InferenceServerClient) -> None:
    content = [sample_paths()["ants"].read_bytes()]
    outputs = ["scores", "probabilities", "class", "classes", "unknown"]
    plain = [triton.InferRequestedOutput(name, binary_data=False) for name in outputs]
    ways = [
        protocol.infer(MODEL, [tensor("mesh", content, binary)], outputs=wanted)
        for binary in (True, False)
        for wanted in (plain, None)
    ]
    for name in outputs:
        first, *others = (values(way, name).astype(str).tolist() for way in ways)
        assert others == [first] * 3


def test_some_outputs_and_the_callers_id(protocol: triton.InferenceServerClient) -> None:
    wanted = [triton.InferRequestedOutput("class")]
    result = protocol.infer(MODEL, [tensor("mesh", samples())], outputs=wanted, request_id="mine")
    response = result.get_response()
    assert response["id"] == "mine"
    assert [output["name"] for output in response["outputs"]] == ["class"]


def test_names_declare_formats(protocol: triton.InferenceServerClient, meshes: Path) -> None:
    ring = (meshes / "ring.obj").read_bytes()
    good = [b"ring.obj", b"obj", b"OBJ", b"", b"ring"]
    protocol.infer(MODEL, [tensor("mesh", [ring] * 5), tensor("name", good)])
    bad = [tensor("mesh", [ring] * 2), tensor("name", [b"obj", b"stl"])]
    with pytest.raises(InferenceServerException, match=r"mesh\[1\]: format-mismatch"):
        protocol.infer(MODEL, bad)


def test_one_bad_mesh_is_named_and_fails_the_request(
    protocol: triton.InferenceServerClient,
) -> None:
    bad = [samples()[0], b"v 0 0 0\nv 1 0 0\n", b"what is this?"]
    with pytest.raises(InferenceServerException) as failed:
        protocol.infer(MODEL, [tensor("mesh", bad)])
    assert failed.value.status() == "422"
    assert failed.value.message().startswith("mesh[1]: no-faces: ")


def test_binary_files_in_base64(client: httpx.Client) -> None:
    content = base64.b64encode(sample_paths()["hand"].read_bytes()).decode()
    mesh = {"name": "mesh", "shape": [1], "datatype": "BYTES", "data": [content]}
    mesh["parameters"] = {"content_type": "base64"}
    response = client.post("/v2/models/tiny/infer", json={"inputs": [mesh]})
    assert response.status_code == 200, response.text
    assert response.json()["model_name"] == "tiny"


def test_the_documented_example_runs(service: Service, capsys: pytest.CaptureFixture[str]) -> None:
    blocks = re.findall(r"```python\n(.*?)```", HTTP.read_text(encoding="utf-8"), re.DOTALL)
    (code,) = (block for block in blocks if "tritonclient" in block)
    code = code.replace("localhost:8000", service.url.removeprefix("http://")).replace(
        '"objects"', f'"{MODEL}"'
    )
    exec(code.replace("model/samples", str(HTTP.parents[1] / "model" / "samples")), {})
    assert capsys.readouterr().out.endswith(" (2, 3)\n")


def mesh(**changes: object) -> dict:
    return {"name": "mesh", "shape": [1], "datatype": "BYTES", "data": ["v 0 0 0"]} | changes


@pytest.mark.parametrize(
    ("inputs", "reason"),
    [
        ([], "the inputs are mesh"),
        ([mesh(name="image")], "the inputs are mesh"),
        ([mesh(), mesh()], "two inputs 'mesh'"),
        ([mesh(), mesh(name="name", data=["a", "b"], shape=[2])], "1 meshes come with 2 names"),
        ([mesh(datatype="FP32")], "should be BYTES"),
        ([mesh(shape=[1, 1])], "array` of length <= 1"),
        ([mesh(shape=[0], data=[])], "should be BYTES of shape"),
        ([mesh(shape=[2])], "has 1 elements, its shape says 2"),
        ([mesh(data=[1])], "inputs[0].data[0]"),
        ([mesh(data=["*"], parameters={"content_type": "base64"})], "is not base64"),
        ([mesh(data=["é"], parameters={"content_type": "base64"})], "is not base64"),
        ([mesh(parameters={"binary_data_size": 4})], "both data and binary data"),
        ([mesh(data=[], parameters={"binary_data_size": -4})], "is not 1 elements"),
        ([mesh(data=[], parameters={"binary_data_size": 8})], "is not 1 elements"),
        ([mesh(parameters={"binary_data_size": "4"})], "binary_data_size"),
        ("mesh", "$.inputs"),
    ],
)
def test_what_is_wrong_with_a_request(client: httpx.Client, inputs: object, reason: str) -> None:
    response = client.post("/v2/models/tiny/infer", json={"inputs": inputs})
    assert response.status_code == 400
    assert list(response.json()) == ["error"]
    assert reason in response.json()["error"]


@pytest.mark.parametrize(
    ("binary", "size", "reason"),
    [
        (b"\1\0", 2, "is not 1 elements"),
        (b"\5\0\0\0ab", 6, "ends within an element"),
        (b"\xff\xff\xff\xffab", 6, "ends within an element"),
        (b"\1\0\0\0a\1\0\0\0b", 10, "is not 1 elements"),
        (b"\1\0\0\0a--", 5, "goes on after the data of its inputs"),
    ],
)
def test_what_is_wrong_with_binary_data(
    client: httpx.Client, binary: bytes, size: int, reason: str
) -> None:
    tensor = mesh(data=[], parameters={"binary_data_size": size})
    head = json.dumps({"inputs": [tensor]}).encode()
    headers = {"inference-header-content-length": str(len(head))}
    response = client.post("/v2/models/tiny/infer", content=head + binary, headers=headers)
    assert response.status_code == 400
    assert reason in response.json()["error"]


@pytest.mark.parametrize("length", ["-1", "many", "999999", "٣", "1e2", "", "9" * 5000])
def test_a_bad_length_of_the_json(client: httpx.Client, length: str) -> None:
    headers = [(b"inference-header-content-length", length.encode())]
    response = client.post("/v2/models/tiny/infer", content=b"{}", headers=headers)
    assert response.status_code == 400
    assert "error" in response.json()


def test_outputs_that_are_not_there(client: httpx.Client, meshes: Path) -> None:
    inputs = [mesh(data=[(meshes / "ring.obj").read_text()])]
    for output, reason in (
        ({"name": "evidence"}, "no output 'evidence', but scores"),
        ({"name": "scores", "parameters": {"classification": 2}}, "'classification'"),
    ):
        asked = {"inputs": inputs, "outputs": [output]}
        response = client.post("/v2/models/tiny/infer", json=asked)
        assert response.status_code == 400
        assert reason in response.json()["error"]


def test_a_request_with_too_many_meshes(client: httpx.Client) -> None:
    crowd = mesh(shape=[65], data=["v"] * 65)
    response = client.post("/v2/models/tiny/infer", json={"inputs": [crowd]})
    assert (response.status_code, list(response.json())) == (413, ["error"])
    assert "64" in response.json()["error"]


def test_every_error_has_the_form_of_the_protocol(client: httpx.Client) -> None:
    answers = {
        404: client.get("/v2/models/other"),
        405: client.get("/v2/models/tiny/infer"),
        413: client.post("/v2/models/tiny/infer", content=b" " * 500_000),
        415: client.post("/v2/models/tiny/infer", headers={"content-encoding": "gzip"}),
    }
    for status, response in answers.items():
        assert response.status_code == status
        assert list(response.json()) == ["error"]
        assert response.headers["content-type"] == "application/json"
        assert response.headers["x-request-id"]
    assert "nothing at this path" in client.get("/v2/nothing").json()["error"]
    assert client.get("/v2nothing").json()["fault"] == "not-found"
