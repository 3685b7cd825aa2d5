"""Which files of a folder are meshes."""

from pathlib import Path

from meshconv3d.model.loading import walk_files, walk_meshes


def test_links_that_lead_nowhere_are_found_and_those_to_folders_are_not(tmp_path: Path) -> None:
    """Who reads what is found says why it cannot."""
    (tmp_path / "mesh.obj").write_text("")
    (tmp_path / "below.obj").mkdir()
    (tmp_path / "a.obj").symlink_to("mesh.obj")
    (tmp_path / "itself.obj").symlink_to("itself.obj")
    (tmp_path / "gone.obj").symlink_to("nowhere.obj")
    (tmp_path / "folder.obj").symlink_to("below.obj")
    found = [path.name for path in walk_meshes(tmp_path)]
    assert found == ["a.obj", "gone.obj", "itself.obj", "mesh.obj"]


def test_hidden_files_and_folders_are_passed_over(tmp_path: Path) -> None:
    """Those of macOS and of editors; the folder that was named may be hidden itself."""
    root = tmp_path / ".hidden"
    for name in ("a.obj", "._a.obj", ".a.obj", "__MACOSX/._b.obj", "__MACOSX/b.obj", ".git/c.obj"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text("")
    (root / "b.blend").write_text("")
    assert [path.name for path in walk_meshes(root)] == ["a.obj"]
    assert [path.name for path in walk_files(root)] == ["a.obj", "b.blend"]
