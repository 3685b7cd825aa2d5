"""Who may ask a running service: API keys, pages of other origins; and what browsers are told."""

import re
import socket
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from meshconv3d.service.http.access import OPEN_PATHS
from meshconv3d.service.settings import Settings
from tests.commands import meshconv3d
from tests.service.conftest import Service
from tests.service.test_http_problems import problem_of

KEYS = ["first-key-of-two-0001", "second-key-of-two-0002"]
FILED = "key-in-a-file-00000003"
ORIGIN = "https://viewer.example:8443"


@pytest.fixture(scope="module")
def guarded(start: Callable[..., Service], tmp_path_factory: pytest.TempPathFactory) -> Service:
    """A service with keys from everywhere, which one origin's pages may ask."""
    path = tmp_path_factory.mktemp("secrets") / "keys"
    path.write_text(f"\n{FILED}\n")
    return start(
        *("--workers", "1", "--api-keys-file", str(path), "--cors-origin", ORIGIN),
        MESHCONV3D_API_KEYS=",".join(KEYS),
    )


@pytest.mark.parametrize("key", [*KEYS, FILED])
def test_each_key_opens_in_either_header(guarded: Service, key: str) -> None:
    for headers in ({"x-api-key": key}, {"authorization": f"Bearer {key}"}):
        assert httpx.get(f"{guarded.url}/v1/models", headers=headers).status_code == 200


@pytest.mark.parametrize(
    ("headers", "fault"),
    [
        ({}, "no-api-key"),
        ({"authorization": f"Basic {KEYS[0]}"}, "no-api-key"),
        ({"x-api-key": ""}, "wrong-api-key"),
        ({"x-api-key": KEYS[0][:-1]}, "wrong-api-key"),
        ({"x-api-key": ",".join(KEYS)}, "wrong-api-key"),
        ({"authorization": f"Bearer {KEYS[0].upper()}"}, "wrong-api-key"),
        ({"authorization": "Bearer é"}, "wrong-api-key"),
    ],
)
def test_nothing_else_opens(guarded: Service, headers: dict[str, str], fault: str) -> None:
    encoded = [(name.encode(), value.encode()) for name, value in headers.items()]
    for path in ("/v1/models", "/metrics", "/openapi.json/", "/v1/nothing"):
        response = httpx.get(f"{guarded.url}{path}", headers=encoded)
        assert problem_of(response, 401)["fault"] == fault
        assert response.headers["www-authenticate"].startswith('Bearer realm="meshconv3d"')
    response = httpx.get(f"{guarded.url}/v2", headers=encoded)
    assert (response.status_code, list(response.json())) == (401, ["error"])


def test_a_body_without_a_key_is_not_waited_for(guarded: Service) -> None:
    host, port = guarded.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=30) as connection:
        connection.sendall(
            b"POST /v1/classify HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99\r\n\r\n"
        )
        assert connection.recv(1000).startswith(b"HTTP/1.1 401 ")


def test_probes_need_no_key(guarded: Service) -> None:
    assert {
        path: httpx.get(f"{guarded.url}{path}").status_code for path in OPEN_PATHS
    } == dict.fromkeys(OPEN_PATHS, 200)


def test_the_page_opens_without_a_key(guarded: Service) -> None:
    """Its files hold no data; what it shows, it asks for with a key."""
    page = httpx.get(guarded.url)
    assert page.status_code == 200
    (script,) = re.findall(r'src="\./(assets/[^"]+\.js)"', page.text)
    assert httpx.get(f"{guarded.url}/{script}").status_code == 200
    for path in ("/assets/../v1/models", "/assets/%2e%2e/v1/models", "//v1/models", "/assetsx"):
        assert httpx.get(f"{guarded.url}{path}").status_code in (401, 404)
    for path in ("/v1/models", "/v1/samples", "/v1/limits"):
        assert httpx.get(f"{guarded.url}{path}").status_code == 401


def test_the_description_needs_no_key_and_gives_nothing_away(guarded: Service) -> None:
    """The page has a link to it, and browsers follow links without a key."""
    answer = httpx.get(f"{guarded.url}/openapi.json")
    assert answer.status_code == 200
    assert "tiny" not in answer.text  # what the models are called


def test_the_description_says_where_keys_are_needed(guarded: Service, service: Service) -> None:
    description = httpx.get(f"{guarded.url}/openapi.json").json()
    schemes = description["components"]["securitySchemes"]
    assert description["security"] == [{name: []} for name in schemes]
    opened = {
        path
        for path, methods in description["paths"].items()
        if all(operation.get("security") == [] for operation in methods.values())
    }
    assert opened == OPEN_PATHS
    assert "security" not in httpx.get(f"{service.url}/openapi.json").json()


def test_keys_are_shown_nowhere(guarded: Service, tmp_path: Path) -> None:
    for key in (*KEYS, FILED, "a-wrong-key-of-someone"):
        httpx.get(f"{guarded.url}/v1/models", headers={"x-api-key": key})
    variables = {"MESHCONV3D_API_KEYS": ",".join(KEYS), "MESHCONV3D_PORT": "none"}
    bad = meshconv3d("serve", variables=variables)
    short = meshconv3d("serve", variables={"MESHCONV3D_API_KEYS": "short-key"})
    assert (bad.returncode, short.returncode) == (2, 2)
    assert "16 characters or more" in short.stderr
    help_text = meshconv3d("serve", "--help", variables=variables).stdout
    assert "--api-key" in help_text
    shown = guarded.log.read_text() + bad.stderr + short.stderr + help_text
    for key in (*KEYS, FILED, "a-wrong-key-of-someone", "short-key"):
        assert key not in shown


@pytest.mark.parametrize(
    ("content", "reason"),
    [("", "holds no API key"), ("short\n", "16 characters"), (None, "cannot be read")],
)
def test_a_file_without_usable_keys_is_refused_at_the_start(
    tmp_path: Path, content: str | None, reason: str
) -> None:
    path = tmp_path / "keys"
    if content is not None:
        path.write_text(content)
    done = meshconv3d("serve", "--api-keys-file", path)
    assert done.returncode == 2
    assert reason in done.stderr


def test_pages_of_the_named_origin_may_ask(guarded: Service) -> None:
    asks = {"access-control-request-method": "POST", "access-control-request-headers": "x-api-key"}
    answers = httpx.options(f"{guarded.url}/v1/classify", headers={"origin": ORIGIN, **asks})
    assert answers.status_code == 200
    assert answers.headers["access-control-allow-origin"] == ORIGIN
    # A page can read what went wrong, too.
    refused = httpx.get(f"{guarded.url}/v1/models", headers={"origin": ORIGIN})
    assert refused.headers["access-control-allow-origin"] == ORIGIN
    assert "x-request-id" in refused.headers["access-control-expose-headers"].lower()


def test_pages_of_other_origins_may_not(guarded: Service, service: Service) -> None:
    asks = {"access-control-request-method": "POST"}
    for origin, running in (("https://other.example", guarded), (ORIGIN, service)):
        answers = [
            httpx.options(f"{running.url}/v1/classify", headers={"origin": origin, **asks}),
            httpx.get(f"{running.url}/livez", headers={"origin": origin}),
        ]
        for answer in answers:
            assert "access-control-allow-origin" not in answer.headers


@pytest.mark.parametrize(
    ("site", "origin", "status"),
    [
        ("cross-site", ORIGIN, 422),
        ("cross-site", "https://other.example", 403),
        ("cross-site", None, 403),
        ("same-origin", None, 422),
        ("none", None, 422),
    ],
)
def test_forms_of_other_sites_are_refused(
    guarded: Service, site: str, origin: str | None, status: int
) -> None:
    headers = {"sec-fetch-site": site, "x-api-key": KEYS[0]} | (
        {"origin": origin} if origin else {}
    )
    url = f"{guarded.url}/v1/classify"
    response = httpx.post(url, files={"file": ("a.obj", b"v 0 0 0")}, headers=headers)
    problem = problem_of(response, status)
    assert problem["fault"] == ("cross-site" if status == 403 else "no-faces")
    assert httpx.get(guarded.url, headers=headers).status_code == 200


@pytest.mark.parametrize(
    ("host", "allowed"),
    [
        ("localhost", True),
        ("LOCALHOST.:8000", True),
        ("127.0.0.1:1", True),
        ("[::1]:8000", True),
        ("rebound.example", False),
        ("localhost.rebound.example", False),
        ("127.0.0.1.rebound.example:8000", False),
        ("", False),
    ],
)
def test_a_loopback_service_answers_for_loopback_names(
    service: Service, host: str, allowed: bool
) -> None:
    for path in ("/", "/v1/models", "/metrics"):
        response = httpx.get(f"{service.url}{path}", headers={"host": host})
        if allowed:
            assert response.status_code == 200
        else:
            assert problem_of(response, 421)["fault"] == "unknown-host"
    assert httpx.get(f"{service.url}/readyz", headers={"host": host}).status_code == 200


@pytest.mark.parametrize(
    ("settings", "names"),
    [
        ({}, {"localhost", "127.0.0.1", "[::1]"}),
        ({"host": "::1"}, {"localhost", "127.0.0.1", "[::1]"}),
        ({"host": "0.0.0.0"}, None),
        ({"host": "mesh.example"}, None),
        ({"allowed_hosts": ("Mesh.Example", "[::1]")}, {"mesh.example", "[::1]"}),
        ({"allowed_hosts": ("*",)}, None),
    ],
)
def test_allowed_hosts_follow_from_the_address(settings: dict, names: set[str] | None) -> None:
    assert Settings(**settings).hosts == names


def test_metrics_have_a_port_of_their_own(start: Callable[..., Service]) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    guarded = start("--workers", "1", "--metrics-port", str(port), "--api-key", KEYS[0])
    metrics = f"http://127.0.0.1:{port}"
    key = {"x-api-key": KEYS[0]}
    assert "meshconv3d_workers_alive 1.0" in httpx.get(f"{metrics}/metrics").text
    assert httpx.get(f"{metrics}/v1/models", headers=key).status_code == 404
    assert httpx.get(f"{guarded.url}/metrics", headers=key).status_code == 404
    assert httpx.get(f"{guarded.url}/v1/models", headers=key).status_code == 200
    # What is refused before it is routed is counted under its route.
    assert httpx.get(f"{guarded.url}/v1/models/x").status_code == 401
    refused = '{fault="no-api-key",route="/v1/models/{name}",status="401"}'
    assert f"meshconv3d_requests_total{refused} 1.0" in httpx.get(f"{metrics}/metrics").text


@pytest.mark.parametrize("origin", ["*", "viewer.example", "https://a.example/path", "null"])
def test_what_is_no_origin_is_refused_at_the_start(origin: str) -> None:
    done = meshconv3d("serve", "--cors-origin", origin)
    assert done.returncode == 2
    assert "bad setting: cors_origins" in done.stderr


@pytest.mark.parametrize("host", ["example.org:8000", "http://example.org", "::1"])
def test_what_is_no_host_is_refused_at_the_start(host: str) -> None:
    with pytest.raises(ValueError, match="name one without a port"):
        Settings(allowed_hosts=(host,))


def test_every_answer_tells_browsers_to_make_nothing_of_it(client: httpx.Client) -> None:
    answers = [
        client.get("/livez"),
        client.get("/metrics"),
        client.get("/nothing"),
        client.get("/v2"),
        client.post("/v1/classify", content=b"#" * 1_000_000),
        client.request("GET", "/livez", headers={"x": "y" * 100_000}),  # before it is a request
    ]
    for answer in answers:
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"
        policy = answer.headers["content-security-policy"]
        assert policy == "default-src 'none'; frame-ancestors 'none'"
        assert "server" not in answer.headers
