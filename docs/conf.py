"""The documentation as a site: `python -m sphinx -W docs site`, with the extra `docs`."""

project = "MeshConv3D"
extensions = ["myst_parser"]
html_theme = "furo"
html_title = project
# Links name headings as GitHub does.
myst_heading_anchors = 4
