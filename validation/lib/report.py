"""The report: one self-contained HTML page and a Markdown summary, from the result folders of the cases."""
import base64
import html
import json

STYLE = """
body{font:15px/1.5 system-ui,sans-serif;max-width:980px;margin:2em auto;padding:0 1em;color:#222}
h1{font-size:1.7em}h2{margin-top:2.2em;border-bottom:1px solid #ccc}
table{border-collapse:collapse;margin:.6em 0;font-size:.88em}
td,th{border:1px solid #ddd;padding:.2em .55em;text-align:right}
td:first-child,th:first-child{text-align:left}
.ok{color:#17703a}.bad{color:#fff;background:#c21d1d;font-weight:bold}
.small{color:#666;font-size:.85em}figure{margin:1em 0}figcaption{font-size:.88em;color:#444}
img{max-width:100%}code{background:#f3f3f3;padding:.1em .3em}
"""


def number(value):
    return f"{value:.3g}"


def load(folder):
    path = folder / "result.json"
    return json.loads(path.read_text()) if path.exists() else None


def verdict(result):
    passed = sum(c["passed"] for c in result["criteria"])
    return passed, len(result["criteria"])


def criteria_table(result):
    rows = "".join(
        f"<tr><td>{html.escape(c['what'])}</td><td>{number(c['value'])} {html.escape(c['unit'])}</td>"
        f"<td>{html.escape(c['bound'])}</td>"
        f"<td class={'ok' if c['passed'] else 'bad'}>{'holds' if c['passed'] else 'FAILS'}</td></tr>"
        for c in result["criteria"])
    return f"<table><tr><th>criterion<th>measured<th>bound<th></tr>{rows}</table>" if rows else ""


def section(case, result, folder, command):
    out = [f"<h2 id={case.NAME}>{html.escape(case.TITLE)}</h2><p>{html.escape(case.QUESTION.strip())}</p>"]
    if result is None:
        return "".join(out) + "<p class=bad>No result: this case has not been run.</p>"
    out.append(f"<p class=small><code>{html.escape(command)} {case.NAME}</code> &middot; "
               f"{result['seconds']:.0f} s &middot; commit {html.escape(result['commit'])} &middot; "
               f"source <code>validation/{case.NAME}/case.py</code></p>")
    out.append(criteria_table(result))
    out += [f"<p>{html.escape(n)}</p>" for n in result["notes"]]
    if result.get("parts"):
        out.append("<p class=small>In parts (processor time, commit): " + html.escape("; ".join(
            f"{p['name']} ({p['seconds']:.0f} s, {p['commit']})" for p in result["parts"])) + "</p>")
    for f in result["figures"]:
        data = base64.b64encode((folder / f"{f['name']}.svg").read_bytes()).decode()
        out.append(f"<figure><img alt='{html.escape(f['name'])}' src='data:image/svg+xml;base64,{data}'>"
                   f"<figcaption>{html.escape(f['caption'])}</figcaption></figure>")
    for t in result["tables"]:
        head = "".join(f"<th>{html.escape(c)}" for c in t["columns"])
        rows = "".join("<tr>" + "".join(f"<td>{html.escape(v)}</td>" for v in row) + "</tr>" for row in t["rows"])
        out.append(f"<p>{html.escape(t['title'])}</p><table><tr>{head}</tr>{rows}</table>")
    return "".join(out)


def summary_rows(cases, folder_of):
    for case in cases:
        result = load(folder_of(case))
        if result is None:
            yield case, "not run", "", ""
            continue
        passed, total = verdict(result)
        failed = [f"{c['what']}: {number(c['value'])} {c['unit']} ({c['bound']})"
                  for c in result["criteria"] if not c["passed"]]
        yield case, f"{passed} of {total}", "; ".join(failed), result["commit"]


def write(cases, folder_of, target, quick, machine):
    target.mkdir(parents=True, exist_ok=True)
    command = "validation/run" + (" --quick" if quick else "")
    rows = list(summary_rows(cases, folder_of))
    table = "".join(
        f"<tr><td><a href=#{c.NAME}>{html.escape(c.TITLE)}</a></td>"
        f"<td class={'bad' if failed or held == 'not run' else 'ok'}>{held}</td><td>{html.escape(failed)}</td></tr>"
        for c, held, failed, _ in rows)
    body = "".join(section(c, load(folder_of(c)), folder_of(c), command) for c in cases)
    kind = "quick run (coarse)" if quick else "full run"
    (target / "index.html").write_text(
        f"<!doctype html><html lang=en><meta charset=utf-8><title>sph_muscle: validation</title>"
        f"<style>{STYLE}</style><h1>sph_muscle: how right is this muscle?</h1>"
        f"<p>{kind}; every number on this page was computed by <code>{command}</code>. {html.escape(machine)}</p>"
        f"<table><tr><th>case<th>criteria that hold<th>what does not</tr>{table}</table>{body}</html>\n")
    lines = ["| case | criteria that hold | what does not | commit |", "|---|---|---|---|"]
    lines += [f"| {c.TITLE} (`{c.NAME}`) | {held} | {failed or '-'} | {made} |" for c, held, failed, made in rows]
    summary = "\n".join(lines) + "\n"
    (target / "summary.md").write_text(summary)
    return summary


def quote(readme, summary):
    """Puts the summary between the marks in the README."""
    begin, end = "<!-- validation:begin -->\n", "<!-- validation:end -->"
    text = readme.read_text()
    if begin in text and end in text:
        readme.write_text(text[:text.index(begin) + len(begin)] + "\n" + summary + "\n" + text[text.index(end):])
