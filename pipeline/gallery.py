"""One page of all figures (`flowloom gallery`): stills, animations, and what each reproduces."""

from __future__ import annotations

import html
from pathlib import Path

from pipeline.errors import BadInput
from pipeline.files import atomic
from pipeline.scene import load
from pipeline.tables import PROJECT_SCENES

PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>flowloom</title>
<style>
body {{ font: 17px/1.5 Georgia, serif; color: #222; max-width: 1100px; margin: 3em auto; padding: 0 1em }}
h2 {{ font-weight: normal; margin: 3em 0 0.3em }} p {{ margin: 0 0 1em; color: #666 }}
img, video {{ max-width: 100%; display: block; margin: 0 0 1em }}
</style>
<h1>flowloom</h1>
{figures}
</html>
"""
FIGURE = """<h2>{title}</h2>
<p>{source} · <code>make {name}</code></p>
<img src="{name}/{name}.png" alt="{title}">
<video src="{name}/{name}.mp4" controls loop muted preload="metadata"></video>
"""


def write(out: Path) -> Path:
    """Write out/gallery.html of the project's scenes whose figure is in `out`; its path."""
    figures = []
    for file in sorted(PROJECT_SCENES.glob("*.toml")):
        if (out / file.stem / f"{file.stem}.png").is_file():
            scene = next(iter(load(file).variants.values()))
            figures.append(FIGURE.format(name=file.stem, title=html.escape(scene.title),
                                         source=html.escape(scene.source)))
    if not figures:
        raise BadInput(out, "", "holds no figure yet; run make figures first")
    page = out / "gallery.html"
    atomic.write_text(page, PAGE.format(figures="\n".join(figures)))
    return page
