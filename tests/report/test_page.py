"""The start page as text and in a browser."""

import itertools
import re
from base64 import b64encode
from dataclasses import replace
from hashlib import sha256
from html.parser import HTMLParser

import pytest

from mtcsirl.claims.unit_text import COLUMNS
from mtcsirl.report.page import build_report
from tests.report.browser import AXE_PLACES, CHROMIUM, audit, inspect
from tests.report.made_up import FIGURES, TASKS, made_up_report

SECTIONS = ["claims", "tables", "figures", "numbers", "gates", "rows", "run", "deviations", "rerun"]
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed: apt-get install chromium")


class Elements(HTMLParser):
    """All start tags with their attributes; refuses tags that are closed in the wrong order."""

    VOID = ("meta", "link", "img", "br")

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def attributes(self, tag, name):
        return [attributes[name] for found, attributes in self.found if found == tag and name in attributes]


@pytest.fixture(scope="module")
def page():
    return build_report(made_up_report())


@pytest.fixture(scope="module", params=[1200, 360], ids=["wide", "narrow"])
def seen(request, page, tmp_path_factory):
    return inspect(page, request.param, tmp_path_factory.mktemp("chromium"))


def test_answers_in_order(page):
    ids = [attributes["id"] for tag, attributes in Elements(page).found if tag == "section"]
    assert ids == SECTIONS
    assert [
        address.removeprefix("#") for address in Elements(page).attributes("a", "href")[: len(SECTIONS)]
    ] == SECTIONS


def test_is_one_file_without_network_and_runs_its_own_script_alone(page):
    elements = Elements(page)
    assert not elements.open
    assert "iframe" not in {tag for tag, _ in elements.found}
    (script,) = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    allowed = re.search(r"script-src 'sha256-([^']+)'", page).group(1)
    assert b64encode(sha256(script.encode()).digest()).decode() == allowed
    assert not elements.attributes("script", "src")
    assert not [name for _, attributes in elements.found for name in attributes if name.startswith("on")]
    addresses = elements.attributes("img", "src") + elements.attributes("link", "href")
    assert all(address.startswith("data:") for address in addresses)
    assert "http://" not in page
    assert "https://" not in page
    assert not re.search(r"url\(|@import", page)


def test_text_is_escaped_once(page):
    assert "with &lt;full&gt; success" in page
    assert "<full>" not in page
    assert "&amp;lt;" not in page


def test_numbers_of_the_run(page):
    for text in ("0123456789ab", "Some Processor 9000", "120 of 130", "170 of 180", "8.5 h", "11.8 h", "612"):
        assert text in page


def test_verdicts_are_counted_and_worded(page):
    for verdict in ("partially", "not reproduced", "inconclusive", "precondition not met", "not run"):
        assert f">{verdict}: 2</span>" in page
        assert page.count(f">{verdict}</span>") == 4, "once on the first screen, once above its numbers"


def test_gates_are_called_gates_and_counted_apart(page):
    claims, gates = re.findall(r"<p>(?:Claims|Gates): (.*?)</p>", page)
    assert ">reproduced: 1<" in claims
    assert re.findall(r">([\w ]+): (\d)<", gates) == [("reproduced", "1")]
    assert page.count(">reproduced (gate)</span>") == 2, "once on the first screen, once above its numbers"
    assert page.count(">reproduced</span>") == 2, "the claim that is none"
    assert page.count("<h3>C1 (gate) ") == 1
    assert "<h3>C2 (gate)" not in page


def test_which_way_settings_lean_stands_where_the_claim_is(page):
    first = page.split('<ol class="verdicts">')[1].split("</li>")[0]
    assert "<strong>Leans for it:</strong> settings were chosen until &lt;it&gt; passed." in first
    assert "<strong>Leans against it:</strong> another thing." in first
    numbers = page.split('id="claim-C1"')[1].split("</article>")[0]
    assert "<strong>Leans for the claim:</strong> settings were chosen until" in numbers
    assert page.count("Leans for") == 2, "no claim without departures has any"
    assert "<p>Thresholds were fixed before; settings were not.</p>" in page


def test_units_for_comparison_are_set_apart(page):
    numbers = page.split('id="claim-C1"')[1].split("</article>")[0]
    assert "<summary>Numbers of C1 (1, and 1 for comparison)</summary>" in numbers
    assert re.findall(r"<tr class=\"shown\"><th scope=\"row\">(.*?)</th>", numbers) == ["velocity, all of them"]
    assert "those in grey are shown for comparison and count nowhere" in numbers
    data = made_up_report()
    alone = build_report(replace(data, claims=(replace(data.claims[0], units=data.claims[0].units[:1]),)))
    assert "for comparison" not in alone
    assert "<summary>Numbers of C1 (1)</summary>" in alone


def test_outcome_power_and_remarks_of_a_unit_can_be_read(page):
    cells = page.split('id="claim-C1"')[1].split("<tbody>")[1].split("</tr>")[0]
    assert '<span class="badge good">met</span> like SAC</td>' in cells
    for remark in ("power 52 % at these spreads and seeds, were both equal", "a &lt;note&gt;"):
        assert f"beside it:</span> {remark}</div>" in cells
    assert 'data-sort="0.03"' in cells, "a column of sentences sorts by its number"


def test_first_answers_what_holds(page):
    """Verdict, sentence and interval of each claim stand before anything else."""
    first = page.split('<section id="claims">')[1].split("</ol>")[0]
    assert first.count("<li>") == 12
    assert first.count("reach both targets with &lt;full&gt; success") == 12
    assert first.count("velocity 0.03 [0.01, 0.05]") == 12
    assert "<table" not in page.split("</ol>")[0]


def test_numbers_behind_a_claim_stand_side_by_side(page):
    numbers = page.split('id="claim-C1"')[1].split("</table>")[0]
    assert "<caption>C1" in numbers
    headings = [heading for name, heading in COLUMNS.items() if name != "unit"]
    for text in (*headings, "yes [0.77, 0.85]", "p &lt; 0.001", "12.1 [6.0, 18.2]"):
        assert text.replace("'", "&#39;") in numbers


def test_every_target_has_its_cost(page):
    assert "<dd>makes table_2: 3 of 4 runs, 90 min</dd>" in page


def test_paper_stands_beside_ours(page):
    table = page.split('id="table_1"')[1].split("</table>")[0]
    assert re.findall(r"<tr[^>]*><th scope=\"row\">(.*?)</th>", table) == list(TASKS)
    assert '<td><strong>0.91±0.03 (n=5) ∈ †1</strong></td><td class="paper">0.91±0.02</td>' in table
    assert '<th scope="rowgroup" colspan="11">velocity, target τ = 0.8</th>' in table
    assert table.count('scope="colgroup" colspan="2"') == len(TASKS)


def test_notes_stand_where_their_kind_belongs(page):
    article = page.split('id="table_1"')[1].split("</article>")[0]
    beside, folded = article.split("<summary>Notes on Table 1 (1)</summary>")
    for text in ('note scale">scale desk', 'note gap">incomplete', 'note mark">†'):
        assert text in beside
    assert "<li>The paper prints no spread.</li>" in folded
    assert "sac.minibatch" not in article, "a section of its own has them all"
    assert '1 setting differs from the paper&#39;s: <a href="#deviations">which</a>' in folded.replace("'", "&#39;")


def test_a_number_leads_to_its_runs_and_their_command(page):
    anchor = re.search(r'<a class="number" href="#(rows-\d+)">0.91±0.03', page).group(1)
    entry = page.split(f'id="{anchor}"')[1].split("</details>")[0]
    assert "2 runs, transfer/multi_target/mt_csirl/velocity/reach-wall/reach-wall-t0</summary>" in entry
    assert (
        '<a href="../transfer/multi_target/mt_csirl/velocity/reach-wall/reach-wall-t0/s0/evaluation.csv">s0</a>'
        in entry
    )
    assert "s1 (not here)" in entry
    command = (
        "snakemake --cores 2 $(mtcsirl target transfer/multi_target/mt_csirl/velocity/reach-wall/reach-wall-t0/s{0,1})"
    )
    assert f"<code>{command}</code>" in entry


def test_equal_runs_are_one_entry_and_numbers_without_runs_are_text(page):
    assert page.count('<details class="rows"') == 2, "those of the table and those of a claim and a gate"
    assert len(re.findall(r'<a class="number" href="#rows-2">', page)) == 12 * 2 + 2
    assert re.search(r"<td>0.81±0.03 \(n=5\) ∈ †1</td>", page)


def test_a_page_without_runs_says_so():
    assert "No rows yet" in build_report(made_up_report(claims=(), gates=(), tables=()))


def test_commands_of_runs_name_their_scale():
    entry = build_report(made_up_report("smoke")).split('id="rows-1"')[1].split("</details>")[0]
    assert "--configfile config/smoke.yaml $(mtcsirl target --scale smoke transfer/" in entry


def test_every_table_leads_to_its_rows_and_its_command(page):
    article = page.split('id="table_1"')[1].split("</article>")[0]
    assert '<a href="../tables/table_1.csv">its rows (CSV)</a>' in article
    assert "rerun: <code>snakemake --cores 2 table_1</code>" in article


@pytest.mark.parametrize(("scale", "options"), [("smoke", "--configfile config/smoke.yaml "), ("desk", "")])
def test_every_artefact_says_how_to_rerun_it(scale, options):
    page = build_report(made_up_report(scale))
    for figure in FIGURES:
        assert f"rerun: <code>snakemake --cores 2 {options}{figure}</code>" in page
    assert ("smoke scale: numbers mean nothing" in page) == (scale == "smoke")


def test_partial_results_say_what_is_missing():
    missing = (("table_2", "Unseen tasks"), ("figure_s1", "drawer-close"))
    page = build_report(made_up_report(missing=missing, claims=(), figures=(), gates=(), tables=()))
    assert "Partial results, not there yet: Table 2, Figure S1." in page
    for text in ("No verdicts yet", "No tables yet", "No figures yet", "No gates yet"):
        assert text in page


def test_unknown_numbers_are_dashes():
    data = made_up_report()
    page = build_report(replace(data, gates=(replace(data.gates[0], success=float("nan"), metric=None),)))
    assert page.count("<td>–</td>") == 2
    assert "nan" not in page.lower().split("<h2>gates</h2>")[1].split("</table>")[0]


def test_heat_map_and_summary_show_where_they_exist():
    data = made_up_report()
    picture = replace(data.figures[0], name="claims_picture", caption="Twelve verdicts")
    heat_map = replace(picture, name="table_1_picture", caption="Ours and the paper's")
    page = build_report(replace(data, claims_picture=picture, tables=(replace(data.tables[0], picture=heat_map),)))
    assert page.index('id="claims"') < page.index("Twelve verdicts") < page.index('id="tables"')
    assert page.index('id="table_1"') < page.index("Ours and the paper&#39;s") < page.index('id="figures"')


def test_durations_are_readable():
    data = made_up_report()
    stages = tuple(replace(data.run.stages[0], cpu_seconds=seconds) for seconds in (12.0, 720.0))
    page = build_report(replace(data, run=replace(data.run, stages=stages)))
    assert "<td>12 s</td>" in page
    assert page.count("<td>12 min</td>") == 2


def test_changes_that_were_not_committed_are_told(page):
    data = made_up_report()
    dirty = build_report(replace(data, run=replace(data.run, commits=("0123456789abcdef+",))))
    assert "<code>0123456789ab+</code> (+: with changes not committed)" in dirty
    assert "not committed" not in page


def test_equal_data_gives_equal_text(page):
    assert build_report(made_up_report()) == page


@needs_chromium
def test_loads_without_complaints(seen):
    assert seen["console"] == []


@needs_chromium
def test_every_figure_shows_and_has_a_text(seen):
    assert len(seen["pictures"]) == len(FIGURES)
    assert len(seen["enlarge"]) == len(FIGURES), "each has a button of its own"
    assert len(set(seen["enlarge"])) == len(FIGURES)
    assert seen["enlarged"] == [True, True, False], "opens in full size with its text, and closes"
    for shows, text in seen["pictures"]:
        assert shows
        assert len(text) > 20


@needs_chromium
def test_fits_the_screen(seen):
    assert seen["overflow"] <= 0
    assert seen["wide"] == []


@needs_chromium
def test_links_within_the_page_lead_somewhere(seen):
    inside = [link for link in seen["links"] if link.startswith("#")]
    assert len(inside) >= len(SECTIONS)
    assert all(link[1:] in seen["ids"] for link in inside)
    assert len(set(seen["ids"])) == len(seen["ids"])


@needs_chromium
def test_headings_leave_no_level_out(seen):
    levels = [int(tag[1]) for tag, _ in seen["headings"]]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(b - a <= 1 for a, b in itertools.pairwise(levels))


@needs_chromium
def test_a_number_unfolds_its_rows(seen):
    assert seen["unfolded"] == [False, True]


@needs_chromium
def test_tables_sort_within_their_sections(seen):
    """By the column of coffee-button: 0.91 in its own row, 0.51 in that of reach-wall."""
    printed = list(TASKS)
    assert seen["sorted"] == [
        ["none", *printed],
        ["ascending", *printed],
        ["descending", *printed[::-1]],
        ["none", *printed],
    ]


AXE = next((path for path in AXE_PLACES if path.is_file()), None)


@needs_chromium
@pytest.mark.skipif(AXE is None, reason="axe-core is not there: npm install --no-save --ignore-scripts axe-core")
@pytest.mark.parametrize("width", [1280, 390])
def test_axe_finds_no_fault(page, width, tmp_path):
    assert audit(page, width, tmp_path, AXE) == []


@needs_chromium
@pytest.mark.skipif(AXE is None, reason="axe-core is not there: npm install --no-save --ignore-scripts axe-core")
def test_axe_finds_a_fault_that_is_there(page, tmp_path):
    broken = page.replace('alt="', 'data-alt="').replace("--quiet: #565656", "--quiet: #bbbbbb")
    assert {"image-alt", "color-contrast"} <= {fault.split(":")[0] for fault in audit(broken, 1280, tmp_path, AXE)}
