"""Self-contained HTML reports: headings, paragraphs, tables and figures in one file."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.files import write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STYLE = """
:root { --ink: #1c2430; --soft: #5d6b7c; --line: #dfe4ea; --accent: #b3202a; --paper: #ffffff; }
* { box-sizing: border-box; }
body { font: 16px/1.55 system-ui, "Segoe UI", Roboto, sans-serif; color: var(--ink); background: #f4f6f8;
  margin: 0; }
main { max-width: 1160px; margin: 0 auto; background: var(--paper); padding: 40px 48px 64px; }
h1 { font-size: 30px; line-height: 1.2; margin: 0 0 8px; }
h2 { font-size: 21px; margin: 40px 0 8px; padding-top: 16px; border-top: 2px solid var(--line); }
p { max-width: 72ch; margin: 8px 0; } p.lead { font-size: 18px; color: var(--soft); }
figure { margin: 16px 0; } figure img { max-width: 100%; height: auto; display: block; }
figcaption { color: var(--soft); font-size: 14px; max-width: 80ch; margin-top: 6px; }
table { border-collapse: collapse; margin: 16px 0; font-variant-numeric: tabular-nums; font-size: 15px; }
th { text-align: left; border-bottom: 2px solid var(--ink); padding: 6px 14px 6px 0; font-weight: 600; }
td { border-bottom: 1px solid var(--line); padding: 6px 14px 6px 0; vertical-align: top; }
td:first-child { white-space: nowrap; }
.numbers { display: flex; flex-wrap: wrap; gap: 16px; margin: 20px 0; }
.number { border: 1px solid var(--line); border-top: 3px solid var(--accent);
  padding: 12px 18px; min-width: 150px; }
.number b { display: block; font-size: 26px; line-height: 1.2; }
.number span { color: var(--soft); font-size: 14px; }
code, pre { font: 14px/1.5 ui-monospace, Menlo, Consolas, monospace; background: #f0f2f5; }
pre { padding: 12px 16px; overflow-x: auto; } code { padding: 1px 4px; }
@media print { body { background: #fff; } main { padding: 0; } }
"""


class Report:
    """An HTML page that grows section by section.

    Parameters
    ----------
    title
        Heading of the page.
    lead
        One or two sentences under it.
    """

    def __init__(self, title: str, lead: str) -> None:
        self._title = title
        self._parts = [f"<h1>{html.escape(title)}</h1>", f'<p class="lead">{html.escape(lead)}</p>']

    def heading(self, text: str) -> None:
        """Begin a section."""
        self._parts.append(f"<h2>{html.escape(text)}</h2>")

    def paragraph(self, text: str) -> None:
        """Plain text."""
        self._parts.append(f"<p>{html.escape(text)}</p>")

    def code(self, text: str) -> None:
        """Commands as one types them."""
        self._parts.append(f"<pre>{html.escape(text)}</pre>")

    def numbers(self, numbers: Sequence[tuple[str, str]]) -> None:
        """The few figures that matter most, as (value, what it is)."""
        boxes = "".join(
            f'<div class="number"><b>{html.escape(value)}</b><span>{html.escape(name)}</span></div>'
            for value, name in numbers
        )
        self._parts.append(f'<div class="numbers">{boxes}</div>')

    def table(self, head: Sequence[str], rows: Sequence[Sequence[Any]], caption: str = "") -> None:
        """A table of texts and numbers, as given."""
        cells = "".join(f"<th>{html.escape(str(name))}</th>" for name in head)
        lines = "".join(
            "<tr>" + "".join(f"<td>{html.escape(str(value))}</td>" for value in row) + "</tr>" for row in rows
        )
        self._parts.append(f"<table><thead><tr>{cells}</tr></thead><tbody>{lines}</tbody></table>")
        if caption:
            self._parts.append(f"<figcaption>{html.escape(caption)}</figcaption>")

    def figure(self, figure: Figure, caption: str) -> None:
        """A matplotlib figure, which is closed afterwards."""
        import matplotlib.pyplot as plt

        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=150, bbox_inches="tight")
        plt.close(figure)
        self._image(buffer.getvalue(), caption)

    def picture(self, pixels: NDArray[np.uint8], caption: str) -> None:
        """An image of shape (height, width, 3)."""
        from PIL import Image

        buffer = io.BytesIO()
        Image.fromarray(pixels).save(buffer, format="PNG", optimize=True)
        self._image(buffer.getvalue(), caption)

    def _image(self, data: bytes, caption: str) -> None:
        text = html.escape(caption, quote=True)
        source = base64.b64encode(data).decode()
        self._parts.append(
            f'<figure><img alt="{text}" src="data:image/png;base64,{source}">'
            f"<figcaption>{text}</figcaption></figure>"
        )

    def write(self, path: Path) -> None:
        """Write the page, whole or not at all.

        Raises
        ------
        UserError
            If it cannot be written there.
        """
        page = (
            f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(self._title)}'
            f'</title><meta name="viewport" content="width=device-width, initial-scale=1">'
            f"<style>{_STYLE}</style></head><body><main>{''.join(self._parts)}</main></body></html>\n"
        )
        write_text(path, page)
