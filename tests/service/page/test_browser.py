"""The page in a real browser: files in, results, 3D, evidence, errors."""

import base64
import csv
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import httpx
import numpy as np
import pytest
from playwright.sync_api import Playwright, Route, expect

from meshconv3d.model import samples
from meshconv3d.model.loading import load_mesh
from tests.articulated import sample_paths
from tests.commands import meshconv3d
from tests.model.loading.loading_builders import archive
from tests.model.loading.scene_builders import dae
from tests.processes import until
from tests.service.conftest import Service
from tests.service.page.conftest import DESKTOP, SOFTWARE, Visitor, stl
from tests.service.page.pixels import blue, changed, orange, pixels

SAMPLES = sample_paths()
SHOWN = samples.sample_paths()  # on the page
POINTS = {"name": "points.obj", "mimeType": "", "buffer": b"v 0 0 0\nv 1 0 0\n"}


def test_a_file_of_every_format_is_drawn_and_classified(visit: Callable[..., Visitor]) -> None:
    """As the service classifies it; several files are a gallery, with a picture of each."""
    visitor = visit(**DESKTOP)
    names = ["ants", "hand", "octopus", "pliers", "snake", "spiders"]
    paths = [SAMPLES[name] for name in names]
    assert {path.suffix for path in paths} == {".obj", ".stl", ".off", ".glb", ".3mf", ".ply"}
    visitor.give(*paths)
    cards = visitor.at("#entries .card")
    expect(visitor.at("#entries .card.done")).to_have_count(len(paths))
    expect(visitor.at("#entries img")).to_have_count(len(paths))
    for path in paths:
        cards.filter(has_text=path.name).click()
        visitor.drawn()
        answer = httpx.post(
            f"{visitor.site.url}/v1/classify", files={"file": (path.name, path.read_bytes())}
        ).json()
        title = "Unknown" if answer["unknown"] else answer["class"].replace("_", " ")
        expect(visitor.at(".verdict")).to_contain_text(title)
        shown = visitor.at(".bars li").first
        expect(shown).to_contain_text(answer["class"].replace("_", " "))
        faces = f"{answer['mesh']['faces_in']:,}".replace(",", "\u202f")
        expect(visitor.at("#result")).to_contain_text(f"Closed, in one piece, {faces} faces")


def gltf_in_pieces(uri: str) -> tuple[bytes, bytes]:
    """A sample as glTF, whose buffer is at an address, and that buffer."""
    content = SAMPLES["two_balls"].read_bytes()
    length = int.from_bytes(content[12:16], "little")
    document = json.loads(content[20 : 20 + length])
    buffer = content[28 + length :][: document["buffers"][0]["byteLength"]]
    document["buffers"] = [{"byteLength": len(buffer), "uri": uri}]
    return json.dumps(document).encode(), buffer


def test_gltf_with_its_buffers_inside(visitor: Visitor) -> None:
    _, buffer = gltf_in_pieces("")
    uri = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
    gltf, _ = gltf_in_pieces(uri)
    visitor.give({"name": "balls.gltf", "mimeType": "", "buffer": gltf})
    visitor.drawn()
    expect(visitor.at(".verdict")).to_have_text("two balls")


def test_an_archive_of_meshes_is_a_gallery(visit: Callable[..., Visitor]) -> None:
    """Each mesh inside is an entry, with its pieces; hidden files and others are none."""
    visitor = visit(**DESKTOP)
    gltf, buffer = gltf_in_pieces("data/balls.bin")
    lamp = SAMPLES["lamp"].read_bytes()
    files = {
        "scans/lamp.obj": lamp,
        "scans/balls.gltf": gltf,
        "scans/data/balls.bin": buffer,
        "hand.stl": SAMPLES["hand"].read_bytes(),
        "read me.txt": b"text",
        "inner.zip": archive({"lamp.obj": lamp}),
        "__MACOSX/._hand.stl": b"hidden",
    }
    visitor.give({"name": "all.zip", "mimeType": "", "buffer": archive(files)})
    names = visitor.at("#entries .card.done .card-name")
    expect(names).to_have_text(["lamp.obj", "balls.gltf", "hand.stl"])
    expect(visitor.at("#entries .card-verdict")).to_contain_text(["lamp", "two balls", "hand"])
    expect(visitor.at("#entries img")).to_have_count(3)
    expect(visitor.at("#passed-over")).to_have_text("1 file passed over: read me.txt")


def test_a_gallery_is_sorted_saved_and_cleared(
    visit: Callable[..., Visitor], tmp_path: Path
) -> None:
    """The CSV has the columns and cells of the command line's; a name is no formula in it."""
    visitor = visit(**DESKTOP)
    hand = SAMPLES["hand"]
    lamp = {"name": "lamp.obj", "mimeType": "", "buffer": SAMPLES["lamp"].read_bytes()}
    other = {"name": "hand.stl", "mimeType": "", "buffer": hand.read_bytes()}
    visitor.give(lamp, POINTS, other, lamp | {"name": '=1+"1".obj'})
    expect(visitor.at("#entries .card.done")).to_have_count(3)
    expect(visitor.at("#entries .card.failed")).to_have_count(1)
    visitor.at("#sort").click()
    names = visitor.at("#entries .card-name")
    expect(names).to_have_text(["hand.stl", "lamp.obj", '=1+"1".obj', "points.obj"])
    with visitor.page.expect_download() as download:
        visitor.at("#csv").click()
    download.value.save_as(tmp_path / "page.csv")
    with (tmp_path / "page.csv").open(newline="") as file:
        rows = {row["file"]: row for row in csv.DictReader(file)}
    assert list(rows) == ["lamp.obj", "points.obj", "hand.stl", '\'=1+"1".obj']
    assert "no triangles" in rows["points.obj"]["error.message"]
    (tmp_path / "in").mkdir()
    shutil.copy(hand, tmp_path / "in")
    made = meshconv3d(
        "batch", tmp_path / "in", "-o", tmp_path / "command.csv", "--model", "shrec11"
    )
    assert made.returncode == 0, made.stderr
    with (tmp_path / "command.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    shown = rows["hand.stl"]
    assert set(shown) < set(row)
    same = set(shown) - {"file", "probability"}
    assert {name: shown[name] for name in same} == {name: row[name] for name in same}
    visitor.at("#entries li").first.locator(".remove").click()
    expect(names).to_have_text(["lamp.obj", '=1+"1".obj', "points.obj"])
    expect(visitor.at(".file-name")).to_have_text("lamp.obj")
    visitor.at("#clear").click()
    expect(visitor.at("#empty")).to_be_visible()
    expect(visitor.at("#result")).to_be_empty()
    expect(visitor.at("#status")).to_be_empty()
    expect(visitor.at("#choose")).to_be_focused()


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"PK\3\4damaged", "no whole zip archive"),
        (archive({"read me.txt": b"text"}), "holds no file of a format that is read"),
    ],
)
def test_an_archive_without_meshes_says_so(visitor: Visitor, content: bytes, reason: str) -> None:
    visitor.give({"name": "all.zip", "mimeType": "", "buffer": content})
    expect(visitor.at("#result .reason")).to_contain_text(reason)


def test_a_dragged_mesh_turns(visitor: Visitor) -> None:
    visitor.give(SAMPLES["ants"])
    visitor.bare()
    view = visitor.at("#view")
    before = pixels(view)
    box = view.bounding_box()
    assert box
    visitor.page.mouse.move(box["x"] + 300, box["y"] + 250)
    visitor.page.mouse.down()
    visitor.page.mouse.move(box["x"] + 450, box["y"] + 290, steps=5)
    visitor.page.mouse.up()
    until(lambda: changed(before, pixels(view)) > 0.02)
    visitor.at("#reset").click()
    until(lambda: changed(before, pixels(view)) < 0.002)


def test_it_turns_by_itself_until_touched(visitor: Visitor) -> None:
    visitor.give(SAMPLES["ants"])
    visitor.bare()
    view = visitor.at("#view")
    visitor.at("#spin").click()
    before = pixels(view)
    until(lambda: changed(before, pixels(view)) > 0.005)
    view.click()
    expect(visitor.at("#spin")).to_have_attribute("aria-pressed", "false")


def test_the_evidence_of_the_winner_is_shown_at_once(visitor: Visitor) -> None:
    """One control switches it off; a class is chosen, and the mesh stays in view."""
    visitor.show_evidence()
    visitor.give(SAMPLES["spiders"])
    view = visitor.at("#view")
    expect(view).to_have_attribute("data-shows", "spiders")
    expect(visitor.at("#strip")).to_contain_text("What speaks for spiders")
    until(lambda: orange(pixels(view)) > 0.01)
    first = pixels(view)
    expect(visitor.at(".bars li")).to_have_count(5)
    visitor.at(".more").click()
    expect(visitor.at(".bars li")).to_have_count(30)
    row = visitor.at(".bars button").last
    other = str(row.get_attribute("data-class"))
    visitor.explain(other)
    expect(view).to_be_in_viewport(ratio=1)
    expect(row).to_have_attribute("aria-pressed", "true")
    until(lambda: changed(first, pixels(view)) > 0.02)
    assert blue(pixels(view)) > blue(first)
    visitor.bare()
    until(lambda: orange(pixels(view)) < 0.001)
    expect(visitor.at("#legend")).to_be_hidden()
    expect(visitor.at('.bars [aria-pressed="true"]')).to_have_count(0)


def test_the_legend_has_its_scale_at_every_width_and_adds_up(visit: Callable[..., Visitor]) -> None:
    visitor = visit(**DESKTOP)
    spiders, lamp = (
        {"name": name, "mimeType": "", "buffer": SAMPLES[name.split(".")[0]].read_bytes()}
        for name in ("spiders.ply", "lamp.obj")
    )
    visitor.give(spiders, lamp, POINTS | {"name": "notes.txt"})
    scale, words = visitor.at("#legend-scale"), visitor.at("#legend-sum")
    expect(scale).to_be_visible()
    expect(visitor.at("#passed-over")).to_have_text("1 file passed over: notes.txt")
    for width in (390, 1024, 1280, 1440):
        visitor.page.set_viewport_size({"width": width, "height": 800})
        assert scale.evaluate("element => element.offsetWidth") >= 120
    text = str(words.text_content())
    assert "-" not in text
    sum_of = re.sub(r"(?<=[+-]) ", "", text.replace("\u2212", "-"))
    score, faces, bias = map(float, re.findall(r"[+-]?\d+\.\d\d", sum_of))
    assert round(faces + bias, 2) == score
    expect(visitor.at("#entries .card.done")).to_have_count(2)
    visitor.at("#entries .remove").last.press("Enter")
    expect(visitor.at("#choose")).to_be_focused()


def test_evidence_that_is_computed_can_be_cancelled(visitor: Visitor) -> None:
    visitor.give(SAMPLES["lamp"])
    visitor.bare()
    held: list[Route] = []
    visitor.page.route("**/v1/explain*", lambda route: held.append(route))
    visitor.at(".more").click()
    visitor.at('button[data-class="hand"]').click()
    expect(visitor.at("#strip")).to_contain_text("Finding what speaks for hand")
    expect(visitor.at("#computing")).to_be_visible()
    expect(visitor.at("#evidence")).to_have_text("Cancel")
    visitor.at("#evidence").click()
    expect(visitor.at("#evidence")).to_have_text("Show")
    expect(visitor.at("#computing")).to_be_hidden()
    expect(visitor.at("#view")).to_have_attribute("data-shows", "mesh")
    visitor.page.unroute("**/v1/explain*")
    visitor.explain("hand")
    assert len(held) == 1


def test_a_weak_answer_names_two_and_a_surer_model(visitor: Visitor) -> None:
    """An unknown mesh shows no full bar. A model without calibration is never surer."""

    def weaken(route: Route) -> None:
        rough = "model=learned" in route.request.url
        share = 0.99 if rough else 0.97 if "model=tiny" in route.request.url else weak
        files = {"file": ("hand.stl", SAMPLES["hand"].read_bytes())}
        answer = httpx.post(route.request.url, files=files).json()
        answer["unknown"] = None if rough else share < 0.5
        answer["probability"] = answer["scores"][0]["probability"] = share
        route.fulfill(json=answer)

    visitor.page.route("**/v1/classify*", weaken)
    weak = 0.6
    visitor.give(SAMPLES["hand"])
    expect(visitor.at(".verdict")).to_contain_text(re.compile("Probably hand, or "))
    expect(visitor.at(".confidence")).to_have_text("60 of 100 answers like this are right.")
    weak = 0.2
    visitor.give(SAMPLES["hand"])
    expect(visitor.at(".verdict")).to_have_text("Unknown")
    fills = visitor.at(".bar-fill").evaluate_all("f => f.map(e => parseFloat(e.style.width))")
    assert max(fills) <= 20
    expect(visitor.at(".surer")).to_contain_text("The model tiny is surer")
    visitor.page.unroute("**/v1/classify*")
    visitor.at(".surer button").click()
    expect(visitor.at(".file-line")).to_contain_text("model tiny")
    expect(visitor.at(".bars li")).to_have_count(3)


def test_a_model_without_calibration_says_that_its_percentages_are_rough(
    visit: Callable[..., Visitor],
) -> None:
    """As one taught from a few examples is."""

    def uncalibrated(route: Route) -> None:
        files = {"file": ("hand.stl", SAMPLES["hand"].read_bytes())}
        answer = httpx.post(route.request.url, files=files).json()
        answer["unknown"] = None
        answer["probability"] = answer["scores"][0]["probability"] = 0.9999
        route.fulfill(json=answer)

    def listed(route: Route) -> None:
        answer = route.fetch().json()
        answer["models"][0] |= {"calibration": None}
        answer["models"][0]["training"] |= {"taught": {"examples": {"hand": 2, "lamp": 2}}}
        route.fulfill(json=answer)

    visitor = visit(**DESKTOP)
    visitor.page.route("**/v1/classify*", uncalibrated)
    visitor.page.route("**/v1/models", listed)
    visitor.page.reload()
    visitor.give(SAMPLES["hand"])
    expect(visitor.at(".bar-value").first).to_have_text(re.compile("^about 99\\s%$"))
    expect(visitor.at(".confidence")).to_contain_text(
        "These percentages are rough: shrec11 had too"
    )
    expect(visitor.at("#result")).not_to_contain_text("of 100")
    visitor.at("#model").click()
    expect(visitor.at("#models button").first).to_contain_text("rough percentages")


def test_which_way_is_up_and_wires(visitor: Visitor, tmp_path: Path) -> None:
    """Found from the shape, where the format says little."""
    mushroom = load_mesh(SHOWN["mushroom"])  # its second axis is up
    x, y, z = mushroom.vertices.T
    for name, vertices, turned in (
        ("y.stl", mushroom.vertices, "false"),
        ("z.stl", np.stack([x, -z, y], axis=1), "true"),
    ):
        visitor.give({"name": name, "mimeType": "", "buffer": stl(vertices[mushroom.faces])})
        visitor.drawn()
        expect(visitor.at("#upright")).to_have_attribute("aria-pressed", turned)
    visitor.bare()
    before = pixels(visitor.at("#view"))
    visitor.at("#wires").click()
    until(lambda: changed(before, pixels(visitor.at("#view"))) > 0.01)
    visitor.at("#wires").click()
    until(lambda: changed(before, pixels(visitor.at("#view"))) < 0.002)


def test_meshes_of_the_library_that_are_like_it(visitor: Visitor) -> None:
    visitor.give(SAMPLES["hand"])
    visitor.classified()
    visitor.at("#result").get_by_role("button", name="Search the library").click()
    expect(visitor.at(".alike li")).to_have_count(len(SAMPLES))
    same = visitor.at(".alike").first
    expect(same.locator("li")).to_have_text([re.compile("hand.stl")])
    expect(visitor.at("#result")).to_contain_text("The same shape is there already")
    expect(visitor.at(".alike img")).to_have_count(len(SAMPLES))


def test_a_search_that_fails_says_why(visitor: Visitor) -> None:
    visitor.page.route("**/v1/similar*", lambda route: route.abort())
    visitor.give(SAMPLES["lamp"])
    visitor.classified()
    visitor.at("#result").get_by_role("button", name="Search the library").click()
    expect(visitor.at("#result .reason")).to_contain_text("the connection is gone")
    visitor.page.unroute("**/v1/similar*")
    visitor.at("#result").get_by_role("button", name="Try again").click()
    expect(visitor.at(".alike li")).to_have_count(len(SAMPLES))
    expect(visitor.at("#result .reason")).to_have_count(0)


def test_samples_are_a_click_away(visitor: Visitor) -> None:
    expect(visitor.at("#sample-list img")).to_have_count(len(SHOWN))
    visitor.forget()
    visitor.at("#sample-list .card").filter(has_text="mushroom").click()
    visitor.classified()
    visitor.drawn()
    expect(visitor.at(".file-name")).to_have_text("mushroom.glb")
    expect(visitor.at("#key")).to_be_hidden()  # this service asks for none


def test_what_can_be_taken_along(visitor: Visitor, tmp_path: Path) -> None:
    visitor.give(SAMPLES["lamp"])
    visitor.classified()
    for name, extension in (("GLB", "glb"), ("PLY", "ply"), ("JSON", "json")):
        with visitor.page.expect_download() as download:
            visitor.at(".downloads button").filter(has_text=name).click()
        path = tmp_path / download.value.suggested_filename
        assert path.name == f"lamp.obj-lamp.{extension}"
        download.value.save_as(path)
        if extension == "json":
            record = json.loads(path.read_text())
            assert (record["file"], record["class"]) == ("lamp.obj", "lamp")
            assert len(record["evidence"]["contributions"]) == 500
        else:
            assert len(load_mesh(path).faces) == 500


def test_another_model_is_asked(visit: Callable[..., Visitor]) -> None:
    """The menu says what each knows; the choice is kept, and stands in the address."""
    visitor = visit(**DESKTOP)
    visitor.give(SAMPLES["lamp"])
    visitor.classified()
    visitor.at("#model").click()
    expect(visitor.at("#models button").first).to_contain_text("30 classes, 100 of 100 test meshes")
    expect(visitor.at("#models button").first).to_contain_text("alien, ")
    visitor.page.keyboard.press("Escape")
    visitor.ask("tiny")
    expect(visitor.at("#models")).to_be_hidden()
    expect(visitor.at(".file-line")).to_contain_text("model tiny")
    expect(visitor.at(".bars li")).to_have_count(3)
    assert visitor.page.url.endswith("?model=tiny")
    # One that cannot explain says so.
    visitor.ask("learned")
    expect(visitor.at("#result")).to_contain_text("cannot show its evidence")
    expect(visitor.at(".bars button")).to_have_count(0)
    expect(visitor.at(".downloads button")).to_have_text(["JSON"])
    expect(visitor.at("#strip")).to_be_hidden()
    visitor.page.goto(visitor.site.url)
    expect(visitor.at("#model-name")).to_have_text("learned")
    visitor.page.goto(f"{visitor.site.url}?model=tiny")
    expect(visitor.at("#model-name")).to_have_text("tiny")


@pytest.mark.parametrize(
    ("file", "title", "reason"),
    [
        (POINTS, "This file holds no usable mesh", "There are no triangles (2 points)"),
        (POINTS | {"name": "cup.exe"}, "This format is not read", "does not name a format"),
        (POINTS | {"name": "cup.stl"}, "This format is not read", "is declared as stl"),
        (POINTS | {"buffer": b""}, "This file cannot be read", "The file is empty"),
        ({"name": "a.glb", "mimeType": "", "buffer": b"glTF" + b"\xff" * 40}, "This file", "glTF"),
    ],
)
def test_errors_in_clear_words(visitor: Visitor, file: dict, title: str, reason: str) -> None:
    visitor.give(file)
    expect(visitor.at(".verdict.failed")).to_contain_text(title)
    expect(visitor.at("#result .reason")).to_contain_text(reason)
    expect(visitor.at("#status")).to_contain_text(reason)
    expect(visitor.at("#view-note")).to_have_text("There is nothing to draw")


def test_a_file_that_is_too_large_is_not_sent(visitor: Visitor, tmp_path: Path) -> None:
    path = tmp_path / "big.stl"
    path.write_bytes(b"\0" * 17 * 2**20)
    before = len(visitor.asked)
    visitor.give(path)
    expect(visitor.at(".verdict.failed")).to_have_text("This file is too large")
    expect(visitor.at("#result .reason")).to_contain_text(
        "It has 17.8 MB; the most that is read is 16.8 MB."
    )
    assert not any("classify" in url for url in visitor.asked[before:])


def test_a_service_that_is_gone_can_be_asked_again(visitor: Visitor) -> None:
    visitor.page.route("**/v1/classify*", lambda route: route.abort())
    visitor.give(SAMPLES["lamp"])
    expect(visitor.at(".verdict.failed")).to_have_text("The service does not answer")
    visitor.page.unroute("**/v1/classify*")
    visitor.at("#result button").filter(has_text="Try again").click()
    expect(visitor.at(".verdict")).to_have_text("lamp")


def test_a_file_of_200_000_faces(visitor: Visitor, large_file: Path) -> None:
    """Its upload shows how far it is. It is drawn with fewer, read beside the page, which goes on
    answering; evidence, too."""
    session = visitor.page.context.new_cdp_session(visitor.page)
    slow = {"offline": False, "latency": 0, "downloadThroughput": -1, "uploadThroughput": 3e6}
    session.send("Network.emulateNetworkConditions", slow)
    visitor.show_evidence()
    visitor.give(large_file)
    expect(visitor.at(".verdict.waiting")).to_contain_text("Sending 10 MB … ")
    assert 0 <= float(visitor.at("#result progress").get_attribute("value") or -1) < 1
    visitor.drawn()
    visitor.classified()
    session.send("Network.emulateNetworkConditions", slow | {"uploadThroughput": -1})
    expect(visitor.at("#result")).to_contain_text("200\u202f000 faces, simplified to 500")
    expect(visitor.at("#legend")).to_be_visible()
    expect(visitor.at("#view-note")).to_contain_text("of 200\u202f000 faces")
    view = visitor.at("#view")
    until(lambda: orange(pixels(view)) + blue(pixels(view)) > 0.01)


def test_files_that_the_page_cannot_draw_are_drawn_as_served(visitor: Visitor) -> None:
    """The page reads no COLLADA: it draws the mesh of the explanation, in grey."""
    visitor.give({"name": "box.dae", "mimeType": "", "buffer": dae()})
    visitor.bare()
    expect(visitor.at("#view-note")).to_be_hidden()
    assert orange(pixels(visitor.at("#view"))) < 0.001


def test_dropped_files(visitor: Visitor) -> None:
    content = SAMPLES["lamp"].read_text()
    transfer = visitor.page.evaluate_handle(
        """(content) => {
            const transfer = new DataTransfer();
            transfer.items.add(new File([content], "lamp.obj"));
            return transfer;
        }""",
        content,
    )
    visitor.forget()
    visitor.page.dispatch_event("body", "dragover", {"dataTransfer": transfer})
    expect(visitor.at("#drop-hint")).to_be_visible()
    visitor.page.dispatch_event("body", "drop", {"dataTransfer": transfer})
    expect(visitor.at("#drop-hint")).to_be_hidden()
    expect(visitor.at(".verdict")).to_have_text("lamp")


def test_without_webgl_there_is_still_a_result(
    chromium: tuple[Playwright, str], site: Service
) -> None:
    playwright, program = chromium
    browser = playwright.chromium.launch(
        executable_path=program, args=[*SOFTWARE, "--disable-3d-apis"]
    )
    page = browser.new_page()
    page.goto(site.url)
    page.locator("#files").set_input_files(SAMPLES["lamp"])
    expect(page.locator(".verdict")).to_have_text("lamp")
    expect(page.locator("#view-note")).to_contain_text("WebGL is off")
    browser.close()


def test_its_colours_follow_the_system(visitor: Visitor) -> None:
    for scheme in ("dark", "light"):
        visitor.page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
        assert (pixels(visitor.at("header")).mean() > 128) == (scheme == "light")
