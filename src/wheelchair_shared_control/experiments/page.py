"""One HTML page that needs nothing else: text, tables and pictures, to be read on a phone as on a desk."""
import base64
import html
from pathlib import Path

STYLE = """
:root { color-scheme: light; --ink: #222; --faint: #666; --line: #ddd; --paper: #fff; --shade: #f5f6f8; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1rem; max-width: 70rem; font: 16px/1.5 system-ui, sans-serif; color: var(--ink);
       background: var(--paper); }
h1 { font-size: 1.5rem; line-height: 1.25; margin: 0.5rem 0; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 0.5rem; border-top: 1px solid var(--line); padding-top: 1rem; }
p { margin: 0.5rem 0; max-width: 46rem; }
nav { display: flex; flex-wrap: wrap; gap: 0.3rem 1rem; margin: 0.8rem 0; }
a { color: #1d4f91; }
.figures { display: flex; flex-wrap: wrap; gap: 1rem; align-items: flex-start; }
figure { margin: 0; flex: 1 1 26rem; min-width: 0; max-width: 34rem; }
img { max-width: 100%; height: auto; display: block; }
figcaption { font-size: 0.9rem; color: var(--faint); }
code { display: block; font: 0.78rem/1.4 ui-monospace, monospace; background: var(--shade); padding: 0.4rem 0.5rem;
       margin: 0.3rem 0; overflow-wrap: anywhere; border-radius: 4px; color: var(--ink); }
.table { overflow-x: auto; margin: 0.6rem 0; }
table { border-collapse: collapse; font-size: 0.88rem; }
th, td { text-align: left; padding: 0.3rem 0.7rem 0.3rem 0; border-bottom: 1px solid var(--line); vertical-align: top;
         white-space: nowrap; }
th { font-weight: 600; }
.claims { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 21rem), 1fr)); gap: 0.8rem; }
.claim { border: 1px solid var(--line); border-left-width: 5px; border-radius: 5px; padding: 0.6rem 0.8rem; }
.claim p { margin: 0.2rem 0; }
.claim .measured { font-size: 0.9rem; color: var(--faint); }
.verdict { font-size: 0.8rem; font-weight: 600; }
.good { border-left-color: #2a8a4a; } .good .verdict { color: #1f7a3d; }
.bad { border-left-color: #c0392b; } .bad .verdict { color: #b03024; }
.open { border-left-color: #b08a1e; } .open .verdict { color: #8a6a10; }
.none { border-left-color: #999; } .none .verdict { color: #666; }
"""
KINDS = {
    "reproduced": "good", "reproduced in part": "open", "undecided": "open", "not reproduced": "bad",
    "not tested": "none",
}


def page(title, introduction, sections):
    """The whole document; ``sections`` are [(heading, HTML), ...] made by the functions below."""
    links = "".join(
        '<a href="#s%d">%s</a>' % (number, escape(heading)) for number, (heading, _) in enumerate(sections)
    )
    body = "".join(
        '<section><h2 id="s%d">%s</h2>%s</section>\n' % (number, escape(heading), content)
        for number, (heading, content) in enumerate(sections)
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        "<title>%s</title>\n<style>%s</style></head>\n<body><h1>%s</h1>\n%s\n<nav>%s</nav>\n%s</body></html>\n"
        % (escape(title), STYLE, escape(title), introduction, links, body)
    )


def escape(text):
    """Text as HTML."""
    return html.escape(str(text))


def paragraph(text):
    """A paragraph of plain text."""
    return "<p>%s</p>\n" % escape(text)


def command(text):
    """A command line."""
    return "<code>%s</code>\n" % escape(text)


def figures(entries):
    """Pictures side by side where there is room: [(PNG file, caption, command or ""), ...]."""
    parts = []
    for path, caption, line in entries:
        data = base64.b64encode(Path(path).read_bytes()).decode("ascii")
        parts.append(
            '<figure><img alt="%s" src="data:image/png;base64,%s"><figcaption>%s%s</figcaption></figure>\n'
            % (escape(caption), data, escape(caption), command(line) if line else "")
        )
    return '<div class="figures">%s</div>\n' % "".join(parts)


def table(head, rows):
    """A table that scrolls by itself where it is wider than the page."""
    lines = ["<tr>%s</tr>" % "".join("<th>%s</th>" % escape(cell) for cell in head)]
    lines += ["<tr>%s</tr>" % "".join("<td>%s</td>" % escape(cell) for cell in row) for row in rows]
    return '<div class="table"><table>%s</table></div>\n' % "\n".join(lines)


def claims(entries):
    """``claims.Claim``s as cards."""
    parts = []
    for entry in entries:
        parts.append(
            '<div class="claim %s"><p>%s</p><p class="verdict">%s (%s)</p><p class="measured">%s</p></div>\n'
            % (KINDS[entry.verdict], escape(entry.text), escape(entry.verdict), escape(entry.source),
               escape(entry.measured))
        )
    return '<div class="claims">%s</div>\n' % "".join(parts)
